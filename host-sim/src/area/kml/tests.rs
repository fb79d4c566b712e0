use std::sync::mpsc;
use std::time::Duration;

use super::super::{AreaFileError, AreaFormat, Polygons, parse};
use super::walk::MAX_NESTING;

/// Time after which a parser counts as hanging.
const HANGS_AFTER: Duration = Duration::from_secs(20);

/// A KML as programs write it: with styles, data, texts of several kinds, a point and a hole.
const ORDINARY: &str = r##"<?xml version="1.0" encoding="UTF-8"?>
<!-- exported -->
<kml xmlns="http://www.opengis.net/kml/2.2" xmlns:gx="http://www.google.com/kml/ext/2.2">
<Document><name>Grünfläche &amp; Rain</name><open>1</open>
<Style id="s"><LineStyle><color>ff0000ff</color><width>2</width></LineStyle></Style>
<StyleMap id="m"><Pair><key>normal</key><styleUrl>#s</styleUrl></Pair></StyleMap>
<Schema name="f" id="f"><SimpleField name="crop" type="string"/></Schema>
<Folder><name>north</name>
<Placemark id="1"><name>pad</name><Point><coordinates>7.1,51.2,0</coordinates></Point></Placemark>
<Placemark><name>field</name><description><![CDATA[<b>wheat</b>]]></description>
<ExtendedData><SchemaData schemaUrl="#f"><SimpleData name="crop">wheat</SimpleData></SchemaData>
<Data name="n"><displayName>n</displayName><value>3</value></Data></ExtendedData>
<styleUrl>#m</styleUrl><MultiGeometry><Polygon><extrude>0</extrude>
<altitudeMode>clampToGround</altitudeMode><outerBoundaryIs><LinearRing><coordinates>
1,2,0 5,2,0 5,6,0 1,6,0 1,2,0 </coordinates></LinearRing></outerBoundaryIs>
<innerBoundaryIs><LinearRing><coordinates>2,3 3,3 3,4 2,3</coordinates></LinearRing>
</innerBoundaryIs></Polygon></MultiGeometry></Placemark></Folder>
<SchemaData><SimpleArrayData name="a"><value>1</value></SimpleArrayData></SchemaData>
</Document></kml>"##;

/// The polygons of each text, or why there are none; panics at a text that gets no answer in time.
fn answers(texts: &[String]) -> Vec<Result<Polygons, AreaFileError>> {
    let (answered, answer) = mpsc::channel();
    let asked = texts.to_vec();
    std::thread::spawn(move || {
        for text in asked {
            let Ok(()) = answered.send(parse(&text, AreaFormat::Kml)) else { return };
        }
    });
    let next = |text: &String| {
        let end = String::from_utf8_lossy(&text.as_bytes()[text.len().saturating_sub(80)..]);
        answer.recv_timeout(HANGS_AFTER).unwrap_or_else(|_| panic!("no answer to …{end}"))
    };
    texts.iter().map(next).collect()
}

/// Why the text is refused; panics if it is read.
fn refusal(text: &str) -> String {
    match answers(&[text.to_owned()]).remove(0) {
        Ok(polygons) => panic!("{polygons:?} of {text:.200}"),
        Err(error) => error.to_string(),
    }
}

/// Elements of this name that nest this deep, around a text.
fn nested(name: &str, depth: usize, inside: &str) -> String {
    format!("{}{inside}{}", format!("<{name}>").repeat(depth), format!("</{name}>").repeat(depth))
}

#[test]
fn a_file_cut_anywhere_is_refused() {
    let cuts: Vec<usize> =
        (0..ORDINARY.len()).filter(|&at| ORDINARY.is_char_boundary(at)).collect();
    let texts: Vec<String> = cuts.iter().map(|&at| ORDINARY[..at].to_owned()).collect();
    for (at, answer) in cuts.iter().zip(answers(&texts)) {
        assert!(matches!(answer, Err(AreaFileError::Malformed { .. })), "cut at {at}: {answer:?}");
    }
    let whole = answers(&[ORDINARY.to_owned()]).remove(0).unwrap();
    assert_eq!((whole.outers.len(), whole.holes.len()), (1, 1));
}

#[test]
fn a_file_with_a_character_too_few_gets_an_answer() {
    let without = |(at, char): (usize, char)| {
        format!("{}{}", &ORDINARY[..at], &ORDINARY[at + char.len_utf8()..])
    };
    answers(&ORDINARY.char_indices().map(without).collect::<Vec<_>>());
}

#[test]
fn what_is_not_well_formed_is_named() {
    for (text, why) in [
        ("<kml><Placemark><name>field</name>", "it ends inside `Placemark`"),
        ("<kml><Placemark><Polygon>", "it ends inside `Polygon`"),
        ("<kml><Folder></Document></kml>", "expected `</Folder>`"),
        ("<kml></kml></Folder>", "`</Folder>`"),
        ("<kml><Placemark><Point></Point></Placemark></kml>", "a `Point` without coordinates"),
        ("<Point><coordinates> </coordinates></Point>", "a `Point` without coordinates"),
    ] {
        let refusal = refusal(text);
        assert!(refusal.starts_with("is not KML: "), "{text}: {refusal}");
        assert!(refusal.contains(why), "{text}: {refusal}");
    }
}

#[test]
fn deep_nesting_is_refused_whatever_nests() {
    let polygon = "<Polygon><outerBoundaryIs><LinearRing><coordinates>1,2 5,2 5,6 1,2</coordinates>\
                   </LinearRing></outerBoundaryIs></Polygon>";
    for name in ["a", "Folder", "Document", "MultiGeometry", "Placemark", "kml", "x:y"] {
        let refusal = refusal(&format!("<kml>{}</kml>", nested(name, 20_000, "")));
        assert!(refusal.starts_with("is not KML that can be read: "), "{name}: {refusal}");
    }
    // The crate reads a `kml` that follows another one as if it were inside it.
    let refusal = refusal(&"<kml></kml>".repeat(20_000));
    assert!(refusal.contains("more than one `kml`"), "{refusal}");
    // Four of the elements are the polygon's own, one is `kml`.
    for (depth, is_read) in [(MAX_NESTING - 5, true), (MAX_NESTING - 4, false)] {
        let text = format!("<kml>{}</kml>", nested("Folder", depth, polygon));
        let answer = answers(&[text]).remove(0);
        assert_eq!(answer.is_ok(), is_read, "{depth}: {answer:?}");
    }
    // Many folders that do not nest are none of this.
    let beside = format!("<Folder>{polygon}</Folder>").repeat(300);
    let read = answers(&[format!("<kml>{beside}</kml>")]).remove(0).unwrap();
    assert_eq!(read.outers.len(), 300);
}
