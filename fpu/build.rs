//! Tells the crate whether the compiler lets assembly name the FPU's registers. `rustc` knows them
//! by `vfp2`, which a stable compiler shows to no `cfg`, and which it does not count to the FPU of
//! an Armv8-M.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rustc-check-cfg=cfg(has_vfp2)");
    if std::env::var("TARGET").is_ok_and(|target| target == "thumbv7em-none-eabihf") {
        println!("cargo::rustc-cfg=has_vfp2");
    }
}
