//! Walks a KML text before the crate `kml` reads it, and refuses what that crate cannot stand: it
//! does not end at the end of file inside some elements, recurses into each element, and panics at
//! a `Point` without coordinates. Both read with the same version of `quick-xml`, so that they see
//! the same elements.

use quick_xml::Reader;
use quick_xml::events::Event;

use super::super::polygons::AreaFileError;

/// Most elements that may be inside each other, of any name, the outermost among them.
pub(super) const MAX_NESTING: usize = 64;

/// What the walk has seen so far.
#[derive(Default)]
struct Walk {
    /// Names of the elements around the place, the outermost first.
    open: Vec<String>,
    /// Whether there was an element `kml`.
    has_kml: bool,
    /// Whether the place is inside `coordinates`, and no element has ended in it yet.
    in_coordinates: bool,
    /// Whether the last `coordinates` since the last `Point` began hold a text.
    has_coordinates: bool,
}

/// Refuses a text that the crate `kml` cannot read to its end: one that is not well-formed, that
/// nests deeper than [`MAX_NESTING`], that has more than one `kml`, or a `Point` without
/// coordinates.
pub(super) fn check(text: &str) -> Result<(), AreaFileError> {
    let mut reader = Reader::from_str(text);
    let mut walk = Walk::default();
    loop {
        let event = reader.read_event().map_err(|error| AreaFileError::malformed("KML", &error))?;
        match event {
            Event::Start(start) => walk.begin(start.local_name().as_ref())?,
            Event::End(end) => walk.end(end.local_name().as_ref())?,
            Event::Text(text) => walk.add_text(&text),
            Event::CData(text) => walk.add_text(&text),
            Event::Eof => break,
            _ => {}
        }
    }
    match walk.open.last() {
        Some(name) => Err(AreaFileError::malformed("KML", &format!("it ends inside `{name}`"))),
        None => Ok(()),
    }
}

impl Walk {
    /// An element of this name begins.
    fn begin(&mut self, name: &[u8]) -> Result<(), AreaFileError> {
        let unreadable = |why: &str| AreaFileError::malformed("KML that can be read", &why);
        if self.open.len() == MAX_NESTING {
            let why = format!("its elements nest more than {MAX_NESTING} deep");
            return Err(unreadable(&why));
        }
        self.open.push(String::from_utf8_lossy(name).into_owned());
        match name {
            // The crate reads what follows the end of a `kml` as if it were inside it.
            b"kml" if self.has_kml => return Err(unreadable("it has more than one `kml`")),
            b"kml" => self.has_kml = true,
            b"Point" => self.has_coordinates = false,
            b"coordinates" => (self.in_coordinates, self.has_coordinates) = (true, false),
            _ => {}
        }
        Ok(())
    }

    /// An element of this name ends; the reader has compared it with the one that began.
    fn end(&mut self, name: &[u8]) -> Result<(), AreaFileError> {
        self.open.pop();
        self.in_coordinates = false;
        if name == b"Point" && !self.has_coordinates {
            return Err(AreaFileError::malformed("KML", &"it has a `Point` without coordinates"));
        }
        Ok(())
    }

    /// A text stands inside the innermost element.
    fn add_text(&mut self, text: &[u8]) {
        let is_blank = String::from_utf8_lossy(text).trim().is_empty();
        self.has_coordinates |= self.in_coordinates && !is_blank;
    }
}
