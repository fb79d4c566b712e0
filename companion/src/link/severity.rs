//! The severity of a STATUSTEXT.

/// Severity of a STATUSTEXT.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// INFO: all goes as usual.
    Info,
    /// WARNING: the operator should know, and may have to act.
    Warning,
}
