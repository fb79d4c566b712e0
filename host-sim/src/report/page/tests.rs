use super::*;

#[test]
fn hostile_text_stays_text() {
    let hostile = "</script><script>alert(1)</script><!-- {{script}} & \"";
    let data = ReportData {
        title: hostile.to_owned(),
        scenario_toml: hostile.to_owned(),
        ..ReportData::default()
    };
    let page = html(&data).expect("a page");
    assert!(!page.contains("alert(1)</script>"));
    assert_eq!(page.matches("</script>").count(), TEMPLATE.matches("</script>").count());
    let (_, after) = page.split_once("type=\"application/json\">").expect("the data element");
    let (json, _) = after.split_once("</script>").expect("its end");
    let back: serde_json::Value = serde_json::from_str(json).expect("JSON");
    assert_eq!(back["scenario_toml"], hostile);
}

#[test]
fn asks_for_nothing_from_a_network() {
    let page = html(&ReportData::default()).expect("a page");
    for forbidden in ["src=\"http", "href=\"http", "@import", "url(http"] {
        assert!(!page.contains(forbidden), "{forbidden}");
    }
}
