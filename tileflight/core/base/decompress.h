#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace tileflight::base {

/// Expands LibLZF's format, which PCD's binary_compressed uses, to exactly `size` bytes; nullopt when the input is
/// damaged or holds another number of bytes.
std::optional<std::string> lzf_decompress(std::string_view input, std::size_t size);

/// Throws InputError for 4 GB and more, which the LibLZF library cannot take.
std::string lzf_compress(std::string_view input);

/// Decompression of untrusted bytes; no output larger than `max_bytes` is ever allocated. All functions throw
/// InputError (name, cause) for malformed, truncated or too large input.

/// Whether the bytes are a gzip file (RFC 1952).
bool is_gzip(std::span<const std::byte> bytes);
std::vector<std::byte> gunzip(std::span<const std::byte> bytes, std::size_t max_bytes, const std::string& name);
/// Decompresses a raw deflate stream (RFC 1951) whose output is exactly `size` bytes.
std::vector<std::byte> inflate(std::span<const std::byte> bytes, std::size_t size, const std::string& name);
/// Decompresses Zstandard frames (RFC 8878) whose output is exactly `size` bytes.
std::vector<std::byte> decompress_zstd(std::span<const std::byte> bytes, std::size_t size, const std::string& name);

}  // namespace tileflight::base
