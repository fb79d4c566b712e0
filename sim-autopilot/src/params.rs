//! The parameter protocol's table: names, types and values of one vehicle, and how integers travel.
//!
//! PX4 puts the bytes of an integer into the float of PARAM_VALUE and PARAM_SET
//! (`MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE`) and refuses another type than the parameter's
//! own. ArduPilot casts integers, and casts what it is sent to its own type.

/// How integers travel in the float.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// Values travel by their bytes, as PX4's.
    Bytewise,
    /// Values travel as numbers, as ArduPilot's.
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
    /// MAV_PARAM_TYPE.
    pub fn wire_type(self) -> u8 {
        match self {
            Int8(_) => 2,
            Int16(_) => 4,
            Int(_) => 6,
            Real(_) => 9,
        }
    }

    /// The whole number, of the integer types.
    fn as_i32(self) -> Option<i32> {
        match self {
            Int8(i) => Some(i32::from(i)),
            Int16(i) => Some(i32::from(i)),
            Int(i) => Some(i),
            Real(_) => None,
        }
    }

    /// A value of the same integer type; `None` of a float.
    pub fn with_integer(self, integer: i32) -> Option<Self> {
        self.as_i32().map(|_| self.with_same_type(integer))
    }

    /// A value of the same type from a whole number, kept within the type's range.
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
    table: &'static [(&'static str, ParamValue)],
    encoding: Encoding,
    values: Vec<ParamValue>,
}

impl Params {
    /// The defaults of a sorted table, with this vehicle's own values for some.
    ///
    /// # Panics
    /// If a name is not in the table.
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

    /// Whether it is empty.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// How integers travel.
    pub fn encoding(&self) -> Encoding {
        self.encoding
    }

    /// Index of a name.
    pub fn index(&self, name: &str) -> Option<usize> {
        self.table.binary_search_by(|&(known, _)| known.cmp(name)).ok()
    }

    /// Name and value at an index.
    pub fn get(&self, index: usize) -> Option<(&'static str, ParamValue)> {
        Some((self.table.get(index)?.0, *self.values.get(index)?))
    }

    /// The float a value travels in.
    pub fn to_wire(&self, value: ParamValue) -> f32 {
        match (value, self.encoding) {
            (Real(real), _) => real,
            (value, Encoding::Bytewise) => f32::from_bits(value.as_i32().unwrap_or(0) as u32),
            (value, Encoding::Cast) => value.as_i32().unwrap_or(0) as f32,
        }
    }

    /// Takes what PARAM_SET brought; whether it was taken.
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

    /// The value of a float; 0 where there is none of that name.
    pub fn f32_value(&self, name: &str) -> f32 {
        match self.index(name).and_then(|index| self.values.get(index)) {
            Some(&Real(value)) => value,
            _ => 0.0,
        }
    }

    /// The value of an integer; 0 where there is none of that name.
    pub fn i32_value(&self, name: &str) -> i32 {
        self.index(name).and_then(|index| self.values[index].as_i32()).unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TABLE: &[(&str, ParamValue)] =
        &[("BYTE", Int8(1)), ("LONG", Int(5)), ("REAL", Real(2.5)), ("WORD", Int16(300))];

    #[test]
    fn integers_travel_bytewise_and_the_wrong_type_is_refused() {
        let mut params = Params::new(TABLE, Encoding::Bytewise, &[]);
        assert!(params.set("LONG", f32::from_bits(7), 6));
        assert_eq!(params.i32_value("LONG"), 7);
        assert_eq!(params.to_wire(Int(7)).to_bits(), 7);
        assert!(
            !params.set("LONG", 4.0, 9)
                && !params.set("REAL", f32::NAN, 9)
                && !params.set("NONE", 1.0, 9)
        );
        assert_eq!((params.i32_value("LONG"), params.f32_value("REAL")), (7, 2.5));
    }

    #[test]
    fn integers_are_cast_whatever_type_is_named() {
        let mut params = Params::new(TABLE, Encoding::Cast, &[("WORD", Int16(9))]);
        for (name, wire, kind, holds) in [
            ("LONG", 42.0, 9, 42),
            ("BYTE", 3.0, 2, 3),
            ("WORD", 70_000.0, 6, 32_767),
            ("BYTE", -300.0, 9, -128),
        ] {
            assert!(params.set(name, wire, kind));
            assert_eq!(params.i32_value(name), holds, "{name}");
        }
        assert_eq!(params.to_wire(Int16(-12)), -12.0);
        assert!(!params.set("LONG", f32::NAN, 6) && !params.set("REAL", f32::INFINITY, 9));
        assert_eq!((params.get(0), params.index("WORD")), (Some(("BYTE", Int8(-128))), Some(3)));
    }
}
