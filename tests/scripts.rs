//! Every script that is shipped sends the frames beside it, without a warning.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod support;

#[test]
fn scripts() {
    insta::with_settings!({ snapshot_path => "scripts", prepend_module_to_snapshot => false, omit_expression => true }, {
        insta::glob!("../scripts", "*.motion", |path| {
            insta::assert_snapshot!("scripts", support::listing_and_messages(path));
        });
    });
}
