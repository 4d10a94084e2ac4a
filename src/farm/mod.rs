//! Many machines: what is handed to a render manager, and a scene that travels in one file.
//!
//! Graeco schedules nothing itself. [`Division`] cuts a list of frames into tasks that take about as long as is wanted;
//! [`openjd`] and [`slurm`] write them down for two managers; any other runs the same command lines. [`pack`] puts a scene
//! and everything that it refers to into one file.

pub mod division;
pub mod job;
pub mod openjd;
pub mod pack;
pub mod slurm;

pub use division::{Cost, Division, Slicing, Wish};
pub use job::{Job, Needs};
