//! What a draw is addressed by, besides run and factor.

/// Which pixel of which picture: all of a draw's address but run and factor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct PixelAddress {
    /// Column; may be negative for pixels outside the picture that a filter reaches.
    pub x: i32,
    /// Row, in lines of the whole frame.
    pub y: i32,
    /// Frame number.
    pub frame: i64,
    /// 0 for a progressive frame or a frame's first field, 1 for its second field.
    pub field: u32,
}
