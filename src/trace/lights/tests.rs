//! Light sampling against closed forms.
