#include <cstddef>
#include <cstdint>
#include <string_view>

#include "tileflight/core/base/input_error.h"
#include "tileflight/tiles/tileset/selection.h"

namespace {

using namespace tileflight;

/// The bytes are every file that is asked for: the tileset.json and each external tileset.
class OneFile : public fetch::TileSource {
 public:
  explicit OneFile(std::string_view text)
      : bytes_(reinterpret_cast<const std::byte*>(text.data()),
               reinterpret_cast<const std::byte*>(text.data()) + text.size()) {}

  std::string root_uri() const override { return "tileset.json"; }
  std::vector<std::byte> read(const std::string&) override { return bytes_; }
  std::optional<std::uintmax_t> size(const std::string&) override { return bytes_.size(); }

 private:
  std::vector<std::byte> bytes_;
};

}  // namespace

/// A tileset.json of any bytes: parsed, and the cut of a region taken of it.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    OneFile source({reinterpret_cast<const char*>(data), size});
    tileset::TilesetTree tree(source, {.max_external_chain = 3, .max_nodes = 10000});
    const tileset::Region region{geometry::Vec3::Zero(), geometry::Vec3::Constant(1e4)};
    tileset::select_cut(tree, tileset::region_criterion(region, geometry::SE3(), 1.0));
  } catch (const InputError&) {
    // one clear line is what broken input is worth
  }
  return 0;
}
