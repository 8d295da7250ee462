#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "tileflight/core/imaging/textured_mesh.h"

namespace tileflight::imaging {

/// Numbers of component types, buffer targets, filters and wraps (glTF 2.0, section 5).
enum GltfNumber : int {
  kGltfUnsignedByte = 5121,
  kGltfUnsignedShort = 5123,
  kGltfUnsignedInt = 5125,
  kGltfFloat = 5126,
  kGltfArrayBuffer = 34962,
  kGltfElementArrayBuffer = 34963,
  kGltfLinear = 9729,
  kGltfLinearMipmapLinear = 9987,
  kGltfClampToEdge = 33071,
  kGltfMirroredRepeat = 33648,
  kGltfRepeat = 10497
};

/// Textures of meshes as JPEG.
using EncodedImages = std::map<const RgbImage*, std::vector<std::byte>>;

/// A binary glTF 2.0 under construction: its JSON, and the parts of its binary chunk. A part is made when it is
/// written, so that a large file never stands in memory. All materials are unlit (KHR_materials_unlit).
class GlbDocument {
 public:
  /// Appends the bytes of a part from `begin` up to, not including, `end` to `out`. `begin` is a multiple of 12.
  using Append = std::function<void(std::size_t begin, std::size_t end, std::string& out)>;

  /// `images`: the textures to embed, which must outlive the document. `writes_defaults`: whether offsets, colours and
  /// roughness are written that equal glTF's default.
  GlbDocument(const EncodedImages& images, bool writes_defaults);

  nlohmann::json json;

  /// Appends an item to a list of the JSON. Returns its index.
  std::size_t add(const char* list, nlohmann::json item);
  /// Appends a part to the binary chunk, aligned to four bytes. Returns its offset.
  std::size_t add_part(std::size_t bytes, Append append);
  /// Adds a part and its buffer view; a `target` of 0 is not written. Returns the view's index.
  std::size_t add_view(std::size_t bytes, Append append, int target);
  /// Adds an accessor for `count` elements of a view. Returns its index.
  std::size_t add_accessor(std::size_t view, int component_type, const char* type, std::size_t count,
                           bool normalized = false);
  /// Adds the material of a mesh, with its texture if that is one of the images. Returns its index.
  std::size_t add_material(const TexturedMesh& mesh);

  /// Returns the size of all parts with the gaps between them.
  std::size_t binary_bytes() const { return bytes_; }

 private:
  friend class GlbStream;

  struct Part {
    std::size_t offset = 0, bytes = 0;
    Append append;
  };

  std::size_t add_texture(const TexturedMesh& mesh);
  /// Returns everything before the first part: header, JSON chunk, header of the binary chunk.
  std::string head() const;

  const EncodedImages& images_;
  bool writes_defaults_;
  std::map<const RgbImage*, std::size_t> image_index_;
  std::vector<Part> parts_;
  std::size_t bytes_ = 0;
};

/// Returns the number of bytes from `bytes` to the next multiple of four.
inline std::size_t glb_padding(std::size_t bytes) { return (4 - bytes % 4) % 4; }

/// Returns the file of a document piece by piece, holding less than a megabyte at a time.
class GlbStream {
 public:
  /// The document must outlive the stream and must not change any more.
  explicit GlbStream(const GlbDocument& document) : document_(document), piece_(document.head()) {}

  /// Returns the next piece, which is valid until the next call; an empty one is the end.
  std::string_view next();

 private:
  const GlbDocument& document_;
  std::string piece_;
  bool has_begun_ = false;
  std::size_t part_ = 0;     ///< index of the part to be written next
  std::size_t done_ = 0;     ///< bytes of that part that are written
  std::size_t written_ = 0;  ///< bytes of the binary chunk that are written
};

}  // namespace tileflight::imaging
