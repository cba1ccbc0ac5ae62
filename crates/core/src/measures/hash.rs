//! One number for a state, so that two runs can be compared bit by bit.

use crate::poses::{Poses, Velocities};

const OFFSET_BASIS: u64 = 0xcbf2_9ce4_8422_2325;
const PRIME: u64 = 0x0000_0100_0000_01b3;

/// FNV-1a, 64 bits, over the exact bits of every pose (translation, rotation) and then every velocity (linear,
/// angular), little-endian, in slot order. Equal states give equal hashes on every machine.
pub fn state_hash(poses: &Poses, velocities: &Velocities) -> u64 {
    let mut hash = OFFSET_BASIS;
    for pose in poses.iter() {
        hash = add(hash, &pose.translation.to_array());
        hash = add(hash, &pose.rotation.to_array());
    }
    for velocity in velocities.iter() {
        hash = add(hash, &velocity.linear.to_array());
        hash = add(hash, &velocity.angular.to_array());
    }
    hash
}

fn add(hash: u64, values: &[f32]) -> u64 {
    values.iter().fold(hash, |hash, value| fnv1a(hash, &value.to_bits().to_le_bytes()))
}

fn fnv1a(hash: u64, bytes: &[u8]) -> u64 {
    bytes.iter().fold(hash, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(PRIME))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: the test vectors that Fowler, Noll and Vo publish for FNV-1a 64.
    #[test]
    fn published_vectors() {
        assert_eq!(fnv1a(OFFSET_BASIS, b""), 0xcbf2_9ce4_8422_2325);
        assert_eq!(fnv1a(OFFSET_BASIS, b"a"), 0xaf63_dc4c_8601_ec8c);
        assert_eq!(fnv1a(OFFSET_BASIS, b"foobar"), 0x8594_4171_f739_67e8);
    }
}
