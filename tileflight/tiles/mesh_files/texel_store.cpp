#include "tileflight/tiles/mesh_files/texel_store.h"

#include <array>

namespace tileflight::mesh_files {
namespace {

using imaging::Rgb8;
using imaging::RgbImage;

constexpr int kBlock_px = 64;
constexpr std::size_t kBlockTexels = std::size_t{kBlock_px} * kBlock_px;

using Block = std::array<Rgb8, kBlockTexels>;

int blocks_along(int length_px) { return (length_px + kBlock_px - 1) / kBlock_px; }

/// The blocks that one thread read last.
class BlockCache {
 public:
  const Block& read(const ScratchFile& file, std::uint64_t offset) {
    if (offset == last_) return *blocks_[slot_];
    last_ = offset;
    slot_ = offset / sizeof(Block) % kSlots;
    if (offsets_[slot_] != offset || !blocks_[slot_]) {
      if (!blocks_[slot_]) blocks_[slot_] = std::make_unique<Block>();
      file.read(offset, blocks_[slot_]->data(), sizeof(Block));
      offsets_[slot_] = offset;
    }
    return *blocks_[slot_];
  }

 private:
  static constexpr std::size_t kSlots = 1021;  // a prime: rows of blocks do not fall onto each other
  std::uint64_t last_ = ~std::uint64_t{0};
  std::size_t slot_ = 0;
  std::array<std::uint64_t, kSlots> offsets_{};
  std::array<std::unique_ptr<Block>, kSlots> blocks_;
};

}  // namespace

std::shared_ptr<const RgbImage> TexelStore::add(const RgbImage& image) {
  const auto stand_in = std::make_shared<RgbImage>();
  stand_in->width = image.width;
  stand_in->height = image.height;
  offset_of_[stand_in.get()] = end_;
  Block block;
  for (int top = 0; top < image.height; top += kBlock_px)
    for (int left = 0; left < image.width; left += kBlock_px) {
      block.fill({});
      const int columns = std::min(kBlock_px, image.width - left), rows = std::min(kBlock_px, image.height - top);
      for (int y = 0; y < rows; ++y)
        std::copy_n(image.row(top + y) + left, columns, block.begin() + static_cast<std::ptrdiff_t>(y) * kBlock_px);
      file_.write(end_, block.data(), sizeof(Block));
      end_ += sizeof(Block);
    }
  texels_ += image.pixels.size();
  stand_ins_.push_back(stand_in);
  return stand_in;
}

TexelFetcher TexelStore::fetcher() const {
  const auto cache = std::make_shared<BlockCache>();
  const RgbImage* last = nullptr;
  std::uint64_t first = 0;
  return [this, cache, last, first](const RgbImage& image, int x, int y) mutable {
    if (&image != last) {
      last = &image;
      first = offset_of_.at(last);
    }
    const auto number =
        static_cast<std::uint64_t>(y / kBlock_px) * static_cast<std::uint64_t>(blocks_along(image.width)) +
        static_cast<std::uint64_t>(x / kBlock_px);
    const Block& block = cache->read(file_, first + number * sizeof(Block));
    return block[static_cast<std::size_t>(y % kBlock_px) * kBlock_px + static_cast<std::size_t>(x % kBlock_px)];
  };
}

}  // namespace tileflight::mesh_files
