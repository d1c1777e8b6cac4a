//! Cameras and adjustments against published recipes, surfaces against real shots.

mod adjust_recipe;
mod mola_windows;
mod pushbroom;
