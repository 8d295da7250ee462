#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

namespace tileflight::tiles {

/// Bytes of unknown origin, unpacked; nothing of more than `max_bytes` is ever made. All throw InputError (name,
/// cause): malformed, cut short, too large.

/// Whether the bytes are a gzip file (RFC 1952).
bool is_gzip(std::span<const std::byte> bytes);
std::vector<std::byte> gunzip(std::span<const std::byte> bytes, std::size_t max_bytes, const std::string& name);
/// A raw deflate stream (RFC 1951) that gives exactly `size` bytes.
std::vector<std::byte> inflate(std::span<const std::byte> bytes, std::size_t size, const std::string& name);
/// Zstandard frames (RFC 8878) that give exactly `size` bytes.
std::vector<std::byte> unpack_zstd(std::span<const std::byte> bytes, std::size_t size, const std::string& name);

}  // namespace tileflight::tiles
