#include "tileflight/core/imaging/etc1s.h"

#include <algorithm>

#include "tileflight/core/base/input_error.h"

namespace tileflight::imaging {
namespace {

/// Runs of code lengths: symbol, number of extra bits, minimum run, and whether the previous length is repeated.
struct LengthRun {
  unsigned bits;
  unsigned min_length;
  bool repeats;
};

LengthRun length_run(std::uint32_t symbol) {
  if (symbol == 17) return {3, 3, false};
  if (symbol == 18) return {7, 11, false};
  if (symbol == 19) return {2, 3, true};
  return {7, 7, true};
}

/// "ETC1S VLC Decoding Procedure": chunks of `payload` bits, each followed by a bit that tells whether another follows.
std::uint32_t read_vlc(BitReader& bits, unsigned payload) {
  std::uint32_t value = 0;
  for (unsigned shift = 0; shift < 32; shift += payload) {
    const std::uint32_t chunk = bits.read(payload + 1);
    value |= (chunk & ((1U << payload) - 1U)) << shift;
    if ((chunk >> payload) == 0) return value;
  }
  throw InputError(bits.name(), "a run in its compressed data is too long");
}

/// "ETC1S Approximate Move to Front Routines": recently used selectors; frequently used ones move to the front.
class SelectorHistory {
 public:
  explicit SelectorHistory(std::size_t size) : values_(size, 0), rover_(size / 2) {}

  void add(std::uint32_t value) {
    if (values_.empty()) return;
    values_[rover_++] = value;
    if (rover_ == values_.size()) rover_ = values_.size() / 2;
  }

  std::uint32_t use(std::size_t index) {
    const std::uint32_t value = values_[index];
    std::swap(values_[index / 2], values_[index]);
    return value;
  }

  std::size_t size() const { return values_.size(); }

 private:
  std::vector<std::uint32_t> values_;
  std::size_t rover_;
};

}  // namespace

HuffmanTable::HuffmanTable(const std::vector<std::uint8_t>& lengths, const std::string& name) {
  for (const std::uint8_t length : lengths) ++counts_[length];
  counts_[0] = 0;
  std::array<std::uint32_t, kMaxCodeBits + 2> first{};
  std::int64_t left = 1;  // unused codes of this length
  for (std::size_t length = 1; length <= kMaxCodeBits; ++length) {
    left = 2 * left - counts_[length];
    if (left < 0) throw InputError(name, "its Huffman code lengths are invalid");
    first[length + 1] = first[length] + counts_[length];
  }
  symbols_.resize(first[kMaxCodeBits + 1]);
  for (std::size_t symbol = 0; symbol < lengths.size(); ++symbol) {
    if (lengths[symbol] > 0) symbols_[first[lengths[symbol]]++] = static_cast<std::uint16_t>(symbol);
  }
}

HuffmanTable HuffmanTable::read(BitReader& bits) {
  static constexpr std::uint8_t kOrder[] = {17, 18, 19, 20, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15, 16};
  const std::size_t count = bits.read(14);
  const std::size_t length_codes = bits.read(5);
  if (length_codes > std::size(kOrder)) throw InputError(bits.name(), "a Huffman table is malformed");
  std::vector<std::uint8_t> code_lengths(std::size(kOrder), 0);
  for (std::size_t i = 0; i < length_codes; ++i) code_lengths[kOrder[i]] = static_cast<std::uint8_t>(bits.read(3));
  const HuffmanTable of_lengths(code_lengths, bits.name());
  std::vector<std::uint8_t> lengths;
  while (lengths.size() < count) {
    const std::uint32_t symbol = of_lengths.decode(bits);
    if (symbol <= 16) {
      lengths.push_back(static_cast<std::uint8_t>(symbol));
      continue;
    }
    const LengthRun run = length_run(symbol);
    const std::size_t repeated = run.min_length + bits.read(run.bits);
    const bool valid = !run.repeats || (!lengths.empty() && lengths.back() != 0);
    if (!valid || repeated > count - lengths.size()) throw InputError(bits.name(), "a Huffman table is malformed");
    lengths.insert(lengths.end(), repeated, run.repeats ? lengths.back() : std::uint8_t{0});
  }
  return {lengths, bits.name()};
}

std::uint32_t HuffmanTable::decode(BitReader& bits) const {
  std::uint32_t code = 0;   // made of the bits read so far
  std::uint32_t first = 0;  // first code of this length
  std::uint32_t index = 0;  // index of that code's symbol
  for (std::size_t length = 1; length <= kMaxCodeBits; ++length) {
    code |= bits.read(1);
    if (code - first < counts_[length]) return symbols_[index + code - first];
    index += counts_[length];
    first = (first + counts_[length]) << 1U;
    code <<= 1U;
  }
  throw InputError(bits.name(), "its compressed data contain an undefined code");
}

Etc1sCodebooks::Etc1sCodebooks(std::size_t endpoint_count, std::span<const std::byte> endpoints,
                               std::size_t selector_count, std::span<const std::byte> selectors,
                               std::span<const std::byte> tables, const std::string& name) {
  if (endpoint_count == 0 || selector_count == 0) throw InputError(name, "a codebook is empty");
  read_endpoints(endpoint_count, BitReader(endpoints, name + ": endpoints"));
  read_selectors(selector_count, BitReader(selectors, name + ": selectors"));
  BitReader bits(tables, name + ": tables");
  endpoint_prediction_ = HuffmanTable::read(bits);
  endpoint_delta_ = HuffmanTable::read(bits);
  selector_ = HuffmanTable::read(bits);
  selector_run_ = HuffmanTable::read(bits);
  history_size_ = bits.read(13);
}

/// "ETC1S Endpoint Codebooks": differences to the previous entry; the Huffman table depends on the previous value.
void Etc1sCodebooks::read_endpoints(std::size_t count, BitReader bits) {
  const std::array<HuffmanTable, 3> color_codes = {HuffmanTable::read(bits), HuffmanTable::read(bits),
                                                   HuffmanTable::read(bits)};
  const HuffmanTable intensity_code = HuffmanTable::read(bits);
  const bool gray = bits.read(1) == 1;
  Endpoint last{{16, 16, 16}, 0};
  for (std::size_t i = 0; i < count; ++i) {
    last.intensity = static_cast<std::uint8_t>((last.intensity + intensity_code.decode(bits)) & 7U);
    for (std::size_t c = 0; c < (gray ? 1U : 3U); ++c) {
      const std::size_t range = last.color[c] <= 9 ? 0 : last.color[c] <= 21 ? 1 : 2;
      last.color[c] = static_cast<std::uint8_t>((last.color[c] + color_codes[range].decode(bits)) & 31U);
    }
    if (gray) last.color[1] = last.color[2] = last.color[0];
    endpoints_.push_back(last);
  }
}

/// "ETC1S Selector Codebooks".
void Etc1sCodebooks::read_selectors(std::size_t count, BitReader bits) {
  if (bits.read(2) != 0) throw InputError(bits.name(), "its reserved bits are set");
  const bool plain = bits.read(1) == 1;
  const HuffmanTable code = plain ? HuffmanTable() : HuffmanTable::read(bits);
  Selector last{};
  for (std::size_t i = 0; i < count; ++i) {
    for (std::uint8_t& row : last) {
      const bool is_delta = !plain && i > 0;
      row = static_cast<std::uint8_t>(is_delta ? row ^ code.decode(bits) : bits.read(8));
    }
    selectors_.push_back(last);
  }
}

/// "ETC1S Slice Block Decoding", for still images: each block is an index into both codebooks.
class Etc1sCodebooks::SliceDecoder {
 public:
  SliceDecoder(const Etc1sCodebooks& books, std::span<const std::byte> slice, std::size_t blocks_x,
               const std::string& name)
      : books_(books),
        bits_(slice, name),
        row_(blocks_x, 0),
        row_above_(blocks_x, 0),
        lower_predictions_((blocks_x + 1) / 2, 0),
        history_(books.history_size_) {}

  void begin_row(std::size_t y) {
    y_ = y;
    row_.swap(row_above_);
  }

  /// Called for each block of a row from left to right.
  std::pair<std::uint32_t, std::uint32_t> endpoint_and_selector(std::size_t x) {
    if (x % 2 == 0) begin_pair(x);
    const std::uint32_t endpoint = next_endpoint(x, predictions_ & 3U);
    predictions_ >>= 2U;
    row_[x] = endpoint;
    last_endpoint_ = endpoint;
    return {endpoint, next_selector()};
  }

 private:
  /// Predictions are coded once for 2 x 2 blocks; those of the lower row are stored until needed.
  void begin_pair(std::size_t x) {
    if (y_ % 2 == 1) {
      predictions_ = lower_predictions_[x / 2];
      return;
    }
    constexpr std::uint32_t kRepeat = 256;
    constexpr std::uint32_t kLeastRun = 3;
    if (prediction_run_ > 0) {
      --prediction_run_;
    } else {
      const std::uint32_t symbol = books_.endpoint_prediction_.decode(bits_);
      if (symbol == kRepeat) {
        prediction_run_ = read_vlc(bits_, 4) + kLeastRun - 1;
      } else {
        last_predictions_ = symbol;
      }
    }
    predictions_ = last_predictions_;
    lower_predictions_[x / 2] = predictions_ >> 4U;
  }

  std::uint32_t next_endpoint(std::size_t x, std::uint32_t prediction) {
    const bool inside = prediction == 0 ? x > 0 : prediction == 1 ? y_ > 0 : prediction == 3 || (x > 0 && y_ > 0);
    if (!inside) throw InputError(bits_.name(), "a block is predicted from outside the image");
    if (prediction == 0) return last_endpoint_;
    if (prediction == 1) return row_above_[x];
    if (prediction == 2) return row_above_[x - 1];
    const std::size_t count = books_.endpoints_.size();
    std::size_t index = last_endpoint_ + books_.endpoint_delta_.decode(bits_);
    if (index >= count) index -= count;
    if (index >= count) throw InputError(bits_.name(), "refers to an endpoint that does not exist");
    return static_cast<std::uint32_t>(index);
  }

  std::uint32_t next_selector() {
    const std::size_t count = books_.selectors_.size();
    const std::uint32_t symbol = selector_symbol();
    if (symbol < count) {
      history_.add(symbol);
      return symbol;
    }
    if (symbol - count >= history_.size()) throw InputError(bits_.name(), "refers to a selector that does not exist");
    return history_.use(symbol - count);
  }

  std::uint32_t selector_symbol() {
    constexpr std::uint32_t kLeastRun = 3;
    constexpr std::uint32_t kLongRun = 63;
    const auto first_of_history = static_cast<std::uint32_t>(books_.selectors_.size());
    if (selector_run_ > 0) {
      --selector_run_;
      return first_of_history;
    }
    const std::uint32_t symbol = books_.selector_.decode(bits_);
    if (symbol != first_of_history + books_.history_size_) return symbol;
    const std::uint32_t run = books_.selector_run_.decode(bits_);
    selector_run_ = (run == kLongRun ? read_vlc(bits_, 7) : run) + kLeastRun - 1;
    return first_of_history;
  }

  const Etc1sCodebooks& books_;
  BitReader bits_;
  std::vector<std::uint32_t> row_, row_above_;    ///< endpoints of blocks
  std::vector<std::uint32_t> lower_predictions_;  ///< for the next row, one per two blocks
  SelectorHistory history_;
  std::size_t y_ = 0;
  std::uint32_t predictions_ = 0;
  std::uint32_t last_predictions_ = 0;
  std::uint32_t prediction_run_ = 0;
  std::uint32_t last_endpoint_ = 0;
  std::uint32_t selector_run_ = 0;
};

/// Paints an ETC1S block (Khronos Data Format Specification, "ETC1S"): a colour of five bits a channel, expanded to
/// eight, plus one of four modifiers for each texel.
void Etc1sCodebooks::paint_block(std::size_t block_x, std::size_t block_y, const Endpoint& endpoint,
                                 const Selector& selector, RgbImage& image) const {
  static constexpr int kModifiers[8][2] = {{2, 8},   {5, 17},  {9, 29},   {13, 42},
                                           {18, 60}, {24, 80}, {33, 106}, {47, 183}};
  const auto [small, large] = kModifiers[endpoint.intensity];
  const std::array<int, 4> modifiers = {-large, -small, small, large};
  std::array<Rgb8, 4> texels{};
  for (std::size_t i = 0; i < 4; ++i) {
    for (std::size_t c = 0; c < 3; ++c) {
      const int base = endpoint.color[c] << 3 | endpoint.color[c] >> 2;
      texels[i][c] = static_cast<std::uint8_t>(std::clamp(base + modifiers[i], 0, 255));
    }
  }
  const int left = static_cast<int>(4 * block_x);
  const int top = static_cast<int>(4 * block_y);
  for (int y = 0; y < std::min(4, image.height - top); ++y) {
    for (int x = 0; x < std::min(4, image.width - left); ++x) {
      image(left + x, top + y) = texels[selector[static_cast<std::size_t>(y)] >> (2 * x) & 3];
    }
  }
}

RgbImage Etc1sCodebooks::decode_slice(std::span<const std::byte> slice, int width, int height,
                                      const std::string& name) const {
  RgbImage image(width, height);
  const auto blocks_x = static_cast<std::size_t>((width + 3) / 4);
  const auto blocks_y = static_cast<std::size_t>((height + 3) / 4);
  SliceDecoder decoder(*this, slice, blocks_x, name);
  for (std::size_t y = 0; y < blocks_y; ++y) {
    decoder.begin_row(y);
    for (std::size_t x = 0; x < blocks_x; ++x) {
      const auto [endpoint, selector] = decoder.endpoint_and_selector(x);
      paint_block(x, y, endpoints_[endpoint], selectors_[selector], image);
    }
  }
  return image;
}

}  // namespace tileflight::imaging
