use super::*;

#[test]
fn pictures_come_back() {
    let dir = tempfile::tempdir().unwrap();
    let picture =
        Picture { vehicle: None, t_s: 7.0, position: Point::new(1.0, 2.0, 3.0), yaw_enu_rad: 0.5 };
    PictureStore::open(dir.path()).unwrap().store_pictures(&[picture]).unwrap();
    let mut pictures = vec![Picture { t_s: 1.0, ..picture }];
    let kept = PictureStore::open(dir.path()).unwrap();
    kept.prepend_earlier_to(&mut pictures);
    assert_eq!(pictures, [Picture { t_s: 0.0, ..picture }, Picture { t_s: 1.0, ..picture }]);
    std::fs::write(dir.path().join(FILE_NAME), "[[1, 2]]").unwrap();
    assert!(PictureStore::open(dir.path()).is_err());
}
