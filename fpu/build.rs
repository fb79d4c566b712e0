//! Sets the cfg `has_vfp2` where the compiler lets inline assembly name the FPU's registers.
//! `rustc` decides that by the target feature `vfp2`, which stable Rust shows to no `cfg`, and
//! which the FPU of an Armv8-M does not have in `rustc`. So it is set for `thumbv7em-none-eabihf`
//! only.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rustc-check-cfg=cfg(has_vfp2)");
    if std::env::var("TARGET").is_ok_and(|target| target == "thumbv7em-none-eabihf") {
        println!("cargo::rustc-cfg=has_vfp2");
    }
}
