//! The pipeline itself: the only module that names every stage.
