//! The program from outside: what it prints, where, and how it ends.

#[path = "../common/mod.rs"]
mod common;

#[cfg(unix)]
mod abuse;
mod bake;
#[cfg(unix)]
mod bench_ao;
mod bench_frames;
#[cfg(unix)]
mod bench_path;
#[cfg(unix)]
mod bench_rays;
mod bench_report;
mod bvh;
mod chosen;
mod compare;
mod compare_ao;
mod compare_renders;
mod compare_text;
mod config;
#[cfg(unix)]
mod confine;
mod convert;
mod image_sets;
mod info;
#[cfg(unix)]
mod limits;
mod manners;
mod measured;
mod outputs;
mod parse;
mod program;
mod quality;
#[cfg(unix)]
mod replaced;
mod report_table;
mod sequences;
mod stress;
