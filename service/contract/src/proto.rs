//! The contract: types, clients and servers generated from `proto/feedwave/v1`, and its descriptors.
#![allow(
    missing_docs,
    unreachable_pub,
    unused_qualifications,
    clippy::all,
    clippy::pedantic,
    reason = "generated; the comments are those of the contract"
)]

use std::sync::LazyLock;

use prost_reflect::DescriptorPool;

include!(concat!(env!("OUT_DIR"), "/feedwave.v1.rs"));

/// The encoded descriptor set of the contract with its comments, for reflection.
pub const DESCRIPTOR_SET: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/feedwave_descriptor.bin"));

/// The descriptors of the contract, for the JSON mapping.
pub static DESCRIPTORS: LazyLock<DescriptorPool> =
    LazyLock::new(|| DescriptorPool::decode(DESCRIPTOR_SET).expect("the build wrote a valid descriptor set"));
