//! Memory for large arrays.

use bytemuck::Zeroable;

/// An empty vector with room for `count` elements, on huge pages if the system grants them.
///
/// Rays jump through hundreds of megabytes; with pages of 4 kB nearly every visit of a node also misses the
/// translation cache. Refusal is no error: the memory is the same, only slower.
pub(super) fn large<T>(count: usize) -> Vec<T> {
    let vector = Vec::with_capacity(count);
    #[cfg(target_os = "linux")]
    advise(&vector);
    vector
}

/// `count` elements of zero bytes, likewise. The system hands out such memory as it is first touched, by whichever thread.
pub(super) fn zeroed<T: Zeroable>(count: usize) -> Vec<T> {
    let vector = bytemuck::zeroed_vec(count);
    #[cfg(target_os = "linux")]
    advise(&vector);
    vector
}

/// Asks for huge pages for the room of `vector`.
#[cfg(target_os = "linux")]
#[allow(unsafe_code, reason = "advice to the kernel; diffuse bounces in a million triangles gain 8 %")]
fn advise<T>(vector: &Vec<T>) {
    use nix::sys::mman::{MmapAdvise, madvise};
    const PAGE: usize = 4096;
    const WORTH: usize = 4 << 20;
    let (begin, bytes) = (vector.as_ptr() as usize, vector.capacity() * size_of::<T>());
    if bytes < WORTH {
        return;
    }
    let first = begin.next_multiple_of(PAGE);
    let last = (begin + bytes) / PAGE * PAGE;
    debug_assert!(begin <= first && first < last && last <= begin + bytes, "whole pages of the allocation");
    if let Some(start) = std::ptr::NonNull::new(first as *mut std::ffi::c_void) {
        // SAFETY: the pages lie within one allocation that lives as long as the vector; MADV_HUGEPAGE changes neither
        // their content nor their protection. The outcome does not matter.
        let _ = unsafe { madvise(start, last - first, MmapAdvise::MADV_HUGEPAGE) };
    }
}

#[cfg(test)]
mod tests {
    /// The safe twin is a plain vector: same room, same content, on both sides of the size from which advice is given.
    #[test]
    fn advised_memory_holds_what_a_plain_vector_holds() {
        for count in [0, 1, 1 << 10, (4 << 20) / 8 - 1, (4 << 20) / 8, 3 << 20] {
            let (mut advised, mut plain) = (super::large::<u64>(count), Vec::with_capacity(count));
            assert!(advised.is_empty() && advised.capacity() >= count);
            let begin = advised.as_ptr();
            for i in 0..count as u64 {
                advised.push(crate::numeric::mix64(i));
                plain.push(crate::numeric::mix64(i));
            }
            assert!(advised == plain && std::ptr::eq(advised.as_ptr(), begin), "{count}: it has not moved");
        }
    }
}
