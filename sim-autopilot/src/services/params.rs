//! The parameter table of one vehicle, and the encoding of values in PARAM_VALUE and PARAM_SET.
//!
//! PX4 puts an integer's bytes into the message's float
//! (`MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE`) and refuses a PARAM_SET of another type than
//! the parameter's. ArduPilot sends integers as float numbers and converts a received value to the
//! parameter's type.

/// How an integer is encoded in the message's float.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// The float has the integer's bytes, as in PX4.
    Bytewise,
    /// The float has the integer's value, as in ArduPilot.
    Cast,
}

/// A parameter's value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ParamValue {
    /// INT8.
    Int8(i8),
    /// INT16.
    Int16(i16),
    /// INT32.
    Int(i32),
    /// REAL32.
    Real(f32),
}

use ParamValue::{Int, Int8, Int16, Real};

impl ParamValue {
    /// Number of the type (MAV_PARAM_TYPE).
    pub fn wire_type(self) -> u8 {
        match self {
            Int8(_) => 2,
            Int16(_) => 4,
            Int(_) => 6,
            Real(_) => 9,
        }
    }

    /// The value of an integer type; `None` for a float.
    fn as_i32(self) -> Option<i32> {
        match self {
            Int8(i) => Some(i32::from(i)),
            Int16(i) => Some(i32::from(i)),
            Int(i) => Some(i),
            Real(_) => None,
        }
    }

    /// `integer` as a value of the same integer type, clamped to its range; `None` if this is a
    /// float.
    pub fn with_integer(self, integer: i32) -> Option<Self> {
        self.as_i32().map(|_| self.with_same_type(integer))
    }

    /// `integer` as a value of the same integer type, clamped to its range; an `Int` if this is a
    /// float.
    fn with_same_type(self, integer: i32) -> Self {
        match self {
            Int8(_) => Int8(integer.clamp(i32::from(i8::MIN), i32::from(i8::MAX)) as i8),
            Int16(_) => Int16(integer.clamp(i32::from(i16::MIN), i32::from(i16::MAX)) as i16),
            Int(_) | Real(_) => Int(integer),
        }
    }
}

/// The parameter table of one vehicle, sorted by name.
#[derive(Clone, Debug)]
pub struct Params {
    /// Names and defaults, sorted by name.
    table: &'static [(&'static str, ParamValue)],
    /// How integers are sent.
    encoding: Encoding,
    /// The values, in the order of `table`.
    values: Vec<ParamValue>,
}

impl Params {
    /// The defaults in `table` (sorted by name), replaced by the values in `own` where given.
    ///
    /// # Panics
    /// A name in `own` is not in the table.
    pub fn new(
        table: &'static [(&'static str, ParamValue)],
        encoding: Encoding,
        own: &[(&'static str, ParamValue)],
    ) -> Self {
        let mut params =
            Self { table, encoding, values: table.iter().map(|&(_, value)| value).collect() };
        for &(name, value) in own {
            let index = params.index(name).expect("a vehicle's own parameters are in its table");
            params.values[index] = value;
        }
        params
    }

    /// Number of parameters.
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// Whether there are no parameters.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// How integers are encoded.
    pub fn encoding(&self) -> Encoding {
        self.encoding
    }

    /// Index of the parameter with this name; `None` if there is none.
    pub fn index(&self, name: &str) -> Option<usize> {
        self.table.binary_search_by(|&(known, _)| known.cmp(name)).ok()
    }

    /// Name and value of the parameter at an index; `None` if there is none.
    pub fn get(&self, index: usize) -> Option<(&'static str, ParamValue)> {
        Some((self.table.get(index)?.0, *self.values.get(index)?))
    }

    /// The float that encodes a value in PARAM_VALUE.
    pub fn to_wire(&self, value: ParamValue) -> f32 {
        match (value, self.encoding) {
            (Real(real), _) => real,
            (value, Encoding::Bytewise) => f32::from_bits(value.as_i32().unwrap_or(0) as u32),
            (value, Encoding::Cast) => value.as_i32().unwrap_or(0) as f32,
        }
    }

    /// Applies a PARAM_SET. Returns false, and changes nothing, for an unknown name, an invalid
    /// value, or (PX4) another type.
    pub fn set(&mut self, name: &str, wire: f32, wire_type: u8) -> bool {
        let Some(index) = self.index(name) else { return false };
        let old = self.values[index];
        let foreign = wire_type != old.wire_type();
        self.values[index] = match (old, self.encoding) {
            (_, Encoding::Bytewise) if foreign => return false,
            (Real(_), _) if wire.is_finite() => Real(wire),
            (Real(_), _) => return false,
            (old, Encoding::Bytewise) => old.with_same_type(wire.to_bits() as i32),
            (_, Encoding::Cast) if !wire.is_finite() => return false,
            (old, Encoding::Cast) => old.with_same_type(libm::roundf(wire) as i32),
        };
        true
    }

    /// Value of a float parameter; 0 if there is none of this name.
    pub fn f32_value(&self, name: &str) -> f32 {
        match self.index(name).and_then(|index| self.values.get(index)) {
            Some(&Real(value)) => value,
            _ => 0.0,
        }
    }

    /// Value of an integer parameter; 0 if there is none of this name.
    pub fn i32_value(&self, name: &str) -> i32 {
        self.index(name).and_then(|index| self.values[index].as_i32()).unwrap_or(0)
    }
}

#[cfg(test)]
mod tests;
