//! Cameras and adjustments against published recipes.

mod adjust_recipe;
mod pushbroom;
