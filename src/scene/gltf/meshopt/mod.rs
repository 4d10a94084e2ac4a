//! Decoder of `EXT_meshopt_compression` and `KHR_meshopt_compression`, in safe Rust.
//!
//! Written from the extension's bitstream appendix (Kapoulkine 2020, and 2025 for version 1 of the vertex stream and
//! the colour filter). Every read is bounds-checked; a stream that does not end where it must is refused. Tests compare
//! it with meshoptimizer itself.

mod filter;
mod indices;
mod vertices;

use serde::Deserialize;

/// The extension object of a buffer view.
#[derive(Debug, Default, Clone, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Compressed {
    pub(super) buffer: usize,
    pub(super) byte_offset: u64,
    pub(super) byte_length: u64,
    pub(super) byte_stride: u64,
    pub(super) count: u64,
    pub(super) mode: String,
    pub(super) filter: Option<String>,
}

impl Compressed {
    /// Bytes after decompression.
    pub(super) fn size(&self) -> Option<u64> {
        self.count.checked_mul(self.byte_stride)
    }
}

/// Decompresses one view: `count × byte_stride` bytes, which the caller has bounded.
pub(super) fn decode(how: &Compressed, source: &[u8]) -> Result<Vec<u8>, String> {
    let (Ok(count), Ok(stride)) = (usize::try_from(how.count), usize::try_from(how.byte_stride)) else {
        return Err("its count or stride is too large".into());
    };
    let mut out = match how.mode.as_str() {
        "ATTRIBUTES" if stride.is_multiple_of(4) && (4..=256).contains(&stride) => {
            vertices::decode(source, count, stride)?
        }
        "ATTRIBUTES" => return Err(format!("has a stride of {stride} bytes, expected a multiple of 4 up to 256")),
        "TRIANGLES" | "INDICES" if !matches!(stride, 2 | 4) => {
            return Err(format!("has indices of {stride} bytes, expected 2 or 4"));
        }
        "TRIANGLES" if count.is_multiple_of(3) => indices::triangles(source, count, stride)?,
        "TRIANGLES" => return Err(format!("has {count} indices, expected a multiple of 3")),
        "INDICES" => indices::sequence(source, count, stride)?,
        mode => return Err(format!("has the unknown mode \"{}\"", mode.escape_debug())),
    };
    match (how.filter.as_deref().unwrap_or("NONE"), stride) {
        ("NONE", _) => {}
        ("OCTAHEDRAL", 4) => filter::octahedral_8(&mut out),
        ("OCTAHEDRAL", 8) => filter::octahedral_16(&mut out),
        ("QUATERNION", 8) => filter::quaternion(&mut out),
        ("EXPONENTIAL", _) if stride.is_multiple_of(4) => filter::exponential(&mut out),
        ("COLOR", 4) => filter::color_8(&mut out),
        ("COLOR", 8) => filter::color_16(&mut out),
        (name, _) => {
            return Err(format!("has the filter \"{}\", which does not fit its stride", name.escape_debug()));
        }
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view(mode: &str, filter: &str, count: usize, stride: usize) -> Compressed {
        Compressed {
            count: count as u64,
            byte_stride: stride as u64,
            mode: mode.into(),
            filter: Some(filter.into()),
            ..Compressed::default()
        }
    }

    #[allow(clippy::cast_possible_truncation, reason = "the low bits are meant")]
    /// Smooth with jumps, so that every width of byte group occurs.
    fn bytes(count: usize, seed: u64) -> Vec<u8> {
        (0..count as u64)
            .map(|i| {
                let noise = crate::numeric::mix64(i ^ seed);
                let width = (i / 97) % 9;
                ((i / 16) as u8).wrapping_add((noise & ((1 << width) - 1)) as u8)
            })
            .collect()
    }

    fn vertex_round_trip<const N: usize>() {
        for (count, version) in [(1, 0), (17, 0), (1000, 0), (1, 1), (33, 1), (3000, 1)] {
            let data: Vec<[u8; N]> =
                bytes(count * N, N as u64).chunks_exact(N).map(|c| c.try_into().unwrap()).collect();
            for level in [0, 2, 3] {
                let encoded = ::meshopt::encode_vertex_buffer_level(&data, level, Some(version)).unwrap();
                let ours = decode(&view("ATTRIBUTES", "NONE", count, N), &encoded).unwrap();
                assert_eq!(ours, data.concat(), "{count} vertices of {N} bytes, version {version}, level {level}");
                for cut in [1, encoded.len() / 2, encoded.len() - 1] {
                    assert!(decode(&view("ATTRIBUTES", "NONE", count, N), &encoded[..cut]).is_err());
                }
            }
        }
    }

    #[test]
    fn vertex_streams_decode_as_meshoptimizer_encodes_them() {
        vertex_round_trip::<4>();
        vertex_round_trip::<16>();
        vertex_round_trip::<28>();
        vertex_round_trip::<256>();
    }

    #[allow(clippy::cast_possible_truncation, reason = "numbers below 5000")]
    #[test]
    fn index_streams_decode_as_meshoptimizer_encodes_them() {
        let grid: Vec<u32> = (0..40 * 40)
            .flat_map(|i| {
                let v = i + i / 40;
                [v, v + 1, v + 41, v + 41, v + 1, v + 42]
            })
            .collect();
        let noise: Vec<u32> = (0..999).map(|i| (crate::numeric::mix64(i) % 5000) as u32).collect();
        for list in [&grid, &noise] {
            let encoded = ::meshopt::encode_index_buffer(list, 5000).unwrap();
            let theirs: Vec<u32> = ::meshopt::decode_index_buffer(&encoded, list.len()).unwrap();
            let ours = decode(&view("TRIANGLES", "NONE", list.len(), 4), &encoded).unwrap();
            assert_eq!(ours, bytemuck::cast_slice::<u32, u8>(&theirs));
            let encoded = ::meshopt::encode_index_sequence(list, 5000).unwrap();
            let ours = decode(&view("INDICES", "NONE", list.len(), 4), &encoded).unwrap();
            assert_eq!(ours, bytemuck::cast_slice::<u32, u8>(list));
        }
    }

    #[allow(clippy::cast_possible_truncation, reason = "the low bits are meant")]
    #[test]
    fn filters_agree_with_meshoptimizer() {
        let unit: Vec<[f32; 4]> = (0..500_u64)
            .map(|i| {
                let c = |k: u64| crate::numeric::unit_from_bits(crate::numeric::mix64(i * 4 + k) as u32) * 2.0 - 1.0;
                glam::Vec4::new(c(0), c(1), c(2), c(3)).normalize().to_array()
            })
            .collect();
        let normals: Vec<[f32; 4]> =
            unit.iter().map(|q| glam::Vec3::new(q[0], q[1], q[2]).normalize().extend(0.0).to_array()).collect();
        let colors: Vec<[f32; 4]> = unit.iter().map(|q| q.map(f32::abs)).collect();

        let mut eight = ::meshopt::encode_filter_oct::<i8>(&normals, 8);
        let mut ours: Vec<i8> = eight.concat();
        filter::octahedral_8(bytemuck::cast_slice_mut(&mut ours));
        ::meshopt::decode_filter_oct(&mut eight);
        assert!(farthest(&ours, &eight.concat()) <= 1);

        let mut sixteen = ::meshopt::encode_filter_oct::<i16>(&normals, 12);
        let mut ours: Vec<i16> = sixteen.concat();
        filter::octahedral_16(bytemuck::cast_slice_mut(&mut ours));
        ::meshopt::decode_filter_oct(&mut sixteen);
        assert!(farthest(&ours, &sixteen.concat()) <= 1);

        let mut turns = ::meshopt::encode_filter_quat(&unit, 14);
        let mut ours: Vec<i16> = turns.concat();
        filter::quaternion(bytemuck::cast_slice_mut(&mut ours));
        ::meshopt::decode_filter_quat(&mut turns);
        assert!(farthest(&ours, &turns.concat()) <= 1);

        let mut floats = ::meshopt::encode_filter_exp(&unit, 15, ::meshopt::EncodeExpMode::Separate);
        let mut ours: Vec<u32> = floats.concat();
        filter::exponential(bytemuck::cast_slice_mut(&mut ours));
        ::meshopt::decode_filter_exp(&mut floats);
        assert_eq!(ours, floats.concat());

        let mut tints = ::meshopt::encode_filter_color::<u8>(&colors, 8);
        let mut ours: Vec<u8> = tints.concat();
        filter::color_8(&mut ours);
        ::meshopt::decode_filter_color(&mut tints);
        assert!(farthest(&ours, &tints.concat()) <= 1);

        let mut tints = ::meshopt::encode_filter_color::<u16>(&colors, 13);
        let mut ours: Vec<u16> = tints.concat();
        filter::color_16(bytemuck::cast_slice_mut(&mut ours));
        ::meshopt::decode_filter_color(&mut tints);
        assert!(farthest(&ours, &tints.concat()) <= 1);
    }

    /// The largest difference: meshoptimizer's vector code may round the other way.
    fn farthest<T: Copy + Into<i32>>(ours: &[T], theirs: &[T]) -> i32 {
        assert_eq!(ours.len(), theirs.len());
        ours.iter().zip(theirs).map(|(&a, &b)| (a.into() - b.into()).abs()).max().unwrap()
    }
}
