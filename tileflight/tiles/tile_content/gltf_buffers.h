#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "tileflight/tiles/tile_content/content.h"
#include "tileflight/tiles/tile_content/gltf_document.h"

namespace tileflight::tile_content::gltf {

/// Access to the data of a document's buffers, views and accessors. Every access is bounds-checked before allocation;
/// buffers and compressed views are resolved on first use. Throws InputError (name, part, cause).
class Buffers {
 public:
  /// `binary_chunk`: the GLB's binary chunk; empty for a .gltf. All arguments must outlive this object.
  Buffers(const Document& document, std::span<const std::byte> binary_chunk, const ContentOptions& options,
          const std::string& name);

  /// Returns the content of a view, decompressed if necessary.
  std::span<const std::byte> view(std::size_t index);

  /// Returns the values of an accessor, `components` per element, interleaved; normalised integers become 0..1 or -1..1
  /// (glTF 2.0, section 3.6.2.2), sparse values are applied. `components` must match the accessor.
  std::vector<float> floats(std::size_t accessor, std::size_t components);
  /// Returns the values of a scalar accessor of unsigned integers; sparse values are applied.
  std::vector<std::uint32_t> indices(std::size_t accessor);
  /// Returns the non-negative integers of an accessor of any component type; invalid values become kNoFeature.
  std::vector<std::uint32_t> ids(std::size_t accessor);

 private:
  struct Elements;

  std::span<const std::byte> buffer(std::size_t index);
  std::span<const std::byte> slice(std::size_t buffer_index, std::size_t offset, std::size_t length,
                                   const std::string& where);
  std::vector<std::byte> decompress(const MeshoptView& view, const std::string& where);
  Elements elements(const Accessor& accessor, const std::string& where);
  /// Applies sparse values; `convert` converts from the accessor's type to the output type.
  template <class Out, class Convert>
  void apply_sparse(const Accessor& accessor, std::vector<Out>& values, const Convert& convert,
                    const std::string& where);
  void spend(std::size_t bytes, const std::string& where);

  const Document& document_;
  std::span<const std::byte> binary_chunk_;
  const ContentOptions& options_;
  std::string name_;
  std::map<std::size_t, std::vector<std::byte>> outside_buffers_;
  std::map<std::size_t, std::vector<std::byte>> decompressed_views_;
  std::size_t spent_bytes_ = 0;
};

/// Converts a feature id that is stored as a float; kNoFeature if it is invalid.
std::uint32_t id_from_float(float value);

}  // namespace tileflight::tile_content::gltf
