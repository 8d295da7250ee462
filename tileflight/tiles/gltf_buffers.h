#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "tileflight/tiles/content.h"
#include "tileflight/tiles/gltf_document.h"

namespace tileflight::tiles::gltf {

/// The bytes behind a document's buffers, views and accessors. Each access is checked against what is there before
/// anything is allocated; buffers and compressed views are resolved when first used. Throws InputError (name, part,
/// cause).
class Buffers {
 public:
  /// `binary_chunk`: of the GLB; empty for a .gltf. All arguments must outlive this.
  Buffers(const Document& document, std::span<const std::byte> binary_chunk, const ContentOptions& options,
          const std::string& name);

  /// Content of a view, decompressed where need be.
  std::span<const std::byte> view(std::size_t index);

  /// Values of an accessor, `components` an element, one element after the other; normalised integers become 0..1 or
  /// -1..1 (glTF 2.0, section 3.6.2.2), sparse values stand in their places. `components` must be what the accessor
  /// has.
  std::vector<float> floats(std::size_t accessor, std::size_t components);
  /// An accessor of unsigned integers, one component; sparse values stand in their places.
  std::vector<std::uint32_t> indices(std::size_t accessor);
  /// Whole numbers from 0 up, of any type; what is none is kNoFeature.
  std::vector<std::uint32_t> ids(std::size_t accessor);

 private:
  struct Elements;

  std::span<const std::byte> buffer(std::size_t index);
  std::span<const std::byte> slice(std::size_t buffer_index, std::size_t offset, std::size_t length,
                                   const std::string& where);
  std::vector<std::byte> decompress(const MeshoptView& view, const std::string& where);
  Elements elements(const Accessor& accessor, const std::string& where);
  /// Puts the sparse values in their places; `convert` makes a value of the accessor's type one of the list's.
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

/// A feature id that is kept as a float.
std::uint32_t id_from_float(float value);

}  // namespace tileflight::tiles::gltf
