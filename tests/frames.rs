//! Each script in `tests/frames` compiles to the frames and messages of its snapshot. Files named
//! `err_*` do not compile.

use std::cell::RefCell;

#[test]
fn frames() {
    let misnamed = RefCell::new(Vec::new());
    let _alone = crate::support::one_glob_at_a_time();
    insta::with_settings!({ snapshot_path => "frames", prepend_module_to_snapshot => false, omit_expression => true }, {
        insta::glob!("frames/*.motion", |path| {
            let text = crate::support::listing_and_messages(path);
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            if text.contains("  × ") != name.starts_with("err_") {
                misnamed.borrow_mut().push(name);
            }
            insta::assert_snapshot!("frames", text);
        });
    });
    assert!(misnamed.borrow().is_empty(), "named `err_` and compile, or do not and fail: {misnamed:?}");
}
