#include "tileflight/core/imaging/etc1s.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <map>
#include <random>
#include <vector>

#include "tileflight/core/base/test_byte_strings.h"
#include "tileflight/core/imaging/test_bit_writer.h"

namespace tileflight::imaging::etc1s_test {
namespace {

using base::test_support::to_bytes;
using test_support::BitWriter;

/// A Huffman code of random lengths for some of `symbols` symbols: leaves of a tree grown by repeatedly splitting one
/// of them.
class RandomCode {
 public:
  RandomCode(std::uint32_t symbols, unsigned longest, std::vector<std::uint32_t> used, std::mt19937& random)
      : lengths_(symbols, 0) {
    std::vector<unsigned> leaves = {1, 1};
    while (leaves.size() < used.size()) {
      unsigned& leaf = leaves[random() % leaves.size()];
      if (leaf == longest) continue;
      leaves.push_back(++leaf);
    }
    std::shuffle(leaves.begin(), leaves.end(), random);
    for (std::size_t i = 0; i < used.size(); ++i) lengths_[used[i]] = leaves[i];
    number_codes();
  }

  static RandomCode of_all(std::uint32_t symbols, std::mt19937& random) {
    std::vector<std::uint32_t> used(symbols);
    for (std::uint32_t i = 0; i < symbols; ++i) used[i] = i;
    return {symbols, 15, used, random};
  }

  void put(std::uint32_t symbol, BitWriter& out) const {
    ASSERT_GT(lengths_[symbol], 0U);
    out.code(codes_[symbol], lengths_[symbol]);
  }

  const std::vector<unsigned>& lengths() const { return lengths_; }

 private:
  /// RFC 1951, section 3.2.2: by length, then by symbol.
  void number_codes() {
    codes_.assign(lengths_.size(), 0);
    std::uint32_t code = 0;
    for (unsigned length = 1; length <= 16; ++length, code <<= 1U) {
      for (std::size_t symbol = 0; symbol < lengths_.size(); ++symbol) {
        if (lengths_[symbol] == length) codes_[symbol] = code++;
      }
    }
  }

  std::vector<unsigned> lengths_;
  std::vector<std::uint32_t> codes_;
};

struct LengthSymbol {
  std::uint32_t symbol;
  std::uint32_t extra = 0;
  unsigned extra_bits = 0;
};

/// Lengths with runs of zeros (17: 3 to 10, 18: 11 to 138) and of the last one (19: 3 to 6, 20: 7 to 134).
std::vector<LengthSymbol> with_runs(const std::vector<unsigned>& lengths) {
  std::vector<LengthSymbol> out;
  for (std::size_t i = 0; i < lengths.size();) {
    std::uint32_t run = 1;
    while (i + run < lengths.size() && lengths[i + run] == lengths[i]) ++run;
    if (lengths[i] == 0 && run >= 3) {
      run = std::min(run, 138U);
      out.push_back(run <= 10 ? LengthSymbol{17, run - 3, 3} : LengthSymbol{18, run - 11, 7});
    } else if (i > 0 && lengths[i] == lengths[i - 1] && lengths[i] != 0 && run >= 3) {
      run = std::min(run, 134U);
      out.push_back(run <= 6 ? LengthSymbol{19, run - 3, 2} : LengthSymbol{20, run - 7, 7});
    } else {
      run = 1;
      out.push_back({lengths[i]});
    }
    i += run;
  }
  return out;
}

void write_table(const RandomCode& code, std::mt19937& random, BitWriter& out) {
  const std::vector<LengthSymbol> symbols = with_runs(code.lengths());
  std::vector<std::uint32_t> used;
  for (const LengthSymbol& s : symbols) used.push_back(s.symbol);
  used.insert(used.end(), {0, 1});  // a code has two symbols at least
  std::sort(used.begin(), used.end());
  used.erase(std::unique(used.begin(), used.end()), used.end());
  const RandomCode of_lengths(21, 7, used, random);
  out.number(static_cast<std::uint32_t>(code.lengths().size()), 14);
  out.number(21, 5);
  for (const unsigned symbol : BitWriter::kLengthOrder) out.number(of_lengths.lengths()[symbol], 3);
  for (const LengthSymbol& s : symbols) {
    of_lengths.put(s.symbol, out);
    out.number(s.extra, s.extra_bits);
  }
}

void write_chunked(std::uint32_t value, unsigned payload, BitWriter& out) {
  for (;; value >>= payload) {
    const bool more = (value >> payload) != 0;
    out.number((value & ((1U << payload) - 1U)) | (more ? 1U << payload : 0U), payload + 1);
    if (!more) return;
  }
}

struct Endpoint {
  std::array<std::uint32_t, 3> color;
  std::uint32_t table;
};

using Selector = std::array<std::uint32_t, 16>;  ///< of the texels, row by row

/// A texture of random blocks, randomly encoded in equivalent ways, and the image that it decodes to.
class RandomTexture {
 public:
  RandomTexture(int width, int height, std::uint32_t seed)
      : random_(seed), width_(width), height_(height), blocks_x_((width + 3) / 4), blocks_y_((height + 3) / 4) {
    gray_ = below(4) == 0;
    for (std::uint32_t i = 0; i < 5 + below(60); ++i) {
      endpoints_.push_back({{below(32), below(32), below(32)}, below(8)});
      if (gray_) endpoints_.back().color.fill(endpoints_.back().color[0]);
    }
    selectors_.resize(3 + below(90));
    for (Selector& selector : selectors_) {
      for (std::uint32_t& texel : selector) texel = below(4);
    }
    history_.assign(2 + below(30), 0);
    rover_ = history_.size() / 2;
    choose_predictions();
    choose_blocks();
  }

  RgbImage expected() const {
    static constexpr int kTables[8][4] = {{-8, -2, 2, 8},       {-17, -5, 5, 17},    {-29, -9, 9, 29},
                                          {-42, -13, 13, 42},   {-60, -18, 18, 60},  {-80, -24, 24, 80},
                                          {-106, -33, 33, 106}, {-183, -47, 47, 183}};
    RgbImage image(width_, height_);
    for (int y = 0; y < height_; ++y) {
      for (int x = 0; x < width_; ++x) {
        const std::size_t block = index(x / 4, y / 4);
        const Endpoint& endpoint = endpoints_[block_endpoints_[block]];
        const std::uint32_t texel = selectors_[block_selectors_[block]][static_cast<std::size_t>(4 * (y % 4) + x % 4)];
        for (std::size_t c = 0; c < 3; ++c) {
          const int base = static_cast<int>(endpoint.color[c] * 8 + endpoint.color[c] / 4);
          image(x, y)[c] = static_cast<std::uint8_t>(std::clamp(base + kTables[endpoint.table][texel], 0, 255));
        }
      }
    }
    return image;
  }

  RgbImage decoded() {
    const std::string endpoints = write_endpoints();
    const std::string selectors = write_selectors();
    const RandomCode predictions = RandomCode::of_all(257, random_);
    const RandomCode deltas = RandomCode::of_all(static_cast<std::uint32_t>(endpoints_.size()), random_);
    const RandomCode indices =
        RandomCode::of_all(static_cast<std::uint32_t>(selectors_.size() + history_.size() + 1), random_);
    const RandomCode runs = RandomCode::of_all(64, random_);
    BitWriter tables;
    for (const RandomCode* code : {&predictions, &deltas, &indices, &runs}) write_table(*code, random_, tables);
    tables.number(static_cast<std::uint32_t>(history_.size()), 13);
    const Etc1sCodebooks books(endpoints_.size(), base::test_support::to_bytes(endpoints), selectors_.size(),
                               base::test_support::to_bytes(selectors), base::test_support::to_bytes(tables.bytes()),
                               "e");
    return books.decode_slice(base::test_support::to_bytes(write_slice(predictions, deltas, indices, runs)), width_,
                              height_, "e");
  }

 private:
  std::uint32_t below(std::size_t n) { return static_cast<std::uint32_t>(random_() % n); }

  std::size_t index(int x, int y) const { return static_cast<std::size_t>(y * blocks_x_ + x); }

  /// 0: as the left neighbour, 1: as the one above, 2: as the one above left, 3: by a difference.
  std::uint32_t random_prediction(int x, int y) {
    for (;;) {
      const std::uint32_t prediction = below(4);
      const bool needs_left = prediction == 0 || prediction == 2;
      const bool needs_above = prediction == 1 || prediction == 2;
      if ((x > 0 || !needs_left) && (y > 0 || !needs_above)) return prediction;
    }
  }

  /// Blocks of 2 x 2 share a symbol; sometimes many consecutive symbols are equal.
  void choose_predictions() {
    std::uint32_t run = 0;
    for (int y = 0; y < blocks_y_; y += 2) {
      for (int x = 0; x < blocks_x_; x += 2) {
        const bool again = run > 0 && x > 0 && y > 0;
        if (!again) {
          std::uint32_t symbol = 0;
          for (unsigned i = 0; i < 4; ++i) {
            symbol |= random_prediction(x + static_cast<int>(i % 2), y + static_cast<int>(i / 2)) << (2 * i);
          }
          groups_.push_back(symbol);
          run = below(3) == 0 ? below(70) : 0;
        } else {
          groups_.push_back(groups_.back());
          --run;
        }
      }
    }
  }

  std::uint32_t prediction(int x, int y) const {
    const std::uint32_t group = groups_[static_cast<std::size_t>(y / 2 * ((blocks_x_ + 1) / 2) + x / 2)];
    return group >> (2 * (x % 2 + 2 * (y % 2))) & 3U;
  }

  void choose_blocks() {
    std::uint32_t run = 0;
    for (int y = 0; y < blocks_y_; ++y) {
      for (int x = 0; x < blocks_x_; ++x) {
        switch (prediction(x, y)) {
          case 0:
            block_endpoints_.push_back(block_endpoints_.back());
            break;
          case 1:
            block_endpoints_.push_back(block_endpoints_[index(x, y - 1)]);
            break;
          case 2:
            block_endpoints_.push_back(block_endpoints_[index(x - 1, y - 1)]);
            break;
          default:
            block_endpoints_.push_back(below(endpoints_.size()));
        }
        if (run > 0) {
          --run;
        } else if (below(8) == 0) {
          run = below(5) == 0 ? 70 + below(300) : below(12);
        }
        choose_selector(run > 0);
      }
    }
  }

  /// A new selector goes to the rear half of the history; a reused one moves towards the front.
  void choose_selector(bool front) {
    if (!front && below(2) == 0) {
      const std::uint32_t fresh = below(selectors_.size());
      block_selectors_.push_back(fresh);
      selector_symbols_.push_back(fresh);
      history_[rover_] = fresh;
      rover_ = rover_ + 1 == history_.size() ? history_.size() / 2 : rover_ + 1;
      return;
    }
    const std::uint32_t place = front ? 0 : below(history_.size());
    block_selectors_.push_back(history_[place]);
    selector_symbols_.push_back(static_cast<std::uint32_t>(selectors_.size()) + place);
    std::swap(history_[place], history_[place / 2]);
  }

  std::string write_endpoints() {
    std::vector<RandomCode> codes;
    for (int i = 0; i < 3; ++i) codes.push_back(RandomCode::of_all(32, random_));
    codes.push_back(RandomCode::of_all(8, random_));
    BitWriter out;
    for (const RandomCode& code : codes) write_table(code, random_, out);
    out.number(gray_ ? 1 : 0, 1);
    Endpoint last{{16, 16, 16}, 0};
    for (const Endpoint& endpoint : endpoints_) {
      codes[3].put((endpoint.table - last.table) & 7U, out);
      for (std::size_t c = 0; c < (gray_ ? 1U : 3U); ++c) {
        const std::size_t range = last.color[c] < 10 ? 0 : last.color[c] < 22 ? 1 : 2;
        codes[range].put((endpoint.color[c] - last.color[c]) & 31U, out);
      }
      last = endpoint;
    }
    return out.bytes();
  }

  std::string write_selectors() {
    const bool plain = below(2) == 0;
    BitWriter out;
    out.number(0, 2);
    out.number(plain ? 1 : 0, 1);
    const RandomCode code = RandomCode::of_all(256, random_);
    if (!plain) write_table(code, random_, out);
    std::array<std::uint32_t, 4> last{};
    for (std::size_t i = 0; i < selectors_.size(); ++i) {
      for (std::size_t y = 0; y < 4; ++y) {
        std::uint32_t row = 0;
        for (std::size_t x = 0; x < 4; ++x) row |= selectors_[i][4 * y + x] << (2 * x);
        if (plain || i == 0) {
          out.number(row, 8);
        } else {
          code.put(row ^ last[y], out);
        }
        last[y] = row;
      }
    }
    return out.bytes();
  }

  std::string write_slice(const RandomCode& predictions, const RandomCode& deltas, const RandomCode& indices,
                          const RandomCode& runs) {
    BitWriter out;
    std::size_t group = 0;
    std::uint32_t groups_left = 0;
    std::uint32_t selectors_left = 0;
    std::uint32_t last_endpoint = 0;
    for (int y = 0; y < blocks_y_; ++y) {
      for (int x = 0; x < blocks_x_; ++x) {
        if (x % 2 == 0 && y % 2 == 0) groups_left = write_group(group++, groups_left, predictions, out);
        const std::uint32_t endpoint = block_endpoints_[index(x, y)];
        if (prediction(x, y) == 3) {
          const auto count = static_cast<std::uint32_t>(endpoints_.size());
          deltas.put((endpoint + count - last_endpoint) % count, out);
        }
        last_endpoint = endpoint;
        selectors_left = write_selector(index(x, y), selectors_left, indices, runs, out);
      }
    }
    return out.bytes();
  }

  /// Returns how many of the following symbols are already covered by a run.
  std::uint32_t write_group(std::size_t at, std::uint32_t left, const RandomCode& predictions, BitWriter& out) {
    if (left > 0) return left - 1;
    std::uint32_t run = 0;
    while (at > 0 && at + run < groups_.size() && groups_[at + run] == groups_[at - 1]) ++run;
    if (run < 3 || below(4) == 0) {
      predictions.put(groups_[at], out);
      return 0;
    }
    predictions.put(256, out);
    write_chunked(run - 3, 4, out);
    return run - 1;
  }

  std::uint32_t write_selector(std::size_t at, std::uint32_t left, const RandomCode& indices, const RandomCode& runs,
                               BitWriter& out) {
    if (left > 0) return left - 1;
    const auto front = static_cast<std::uint32_t>(selectors_.size());
    std::uint32_t run = 0;
    while (at + run < selector_symbols_.size() && selector_symbols_[at + run] == front) ++run;
    if (run < 3 || below(4) == 0) {
      indices.put(selector_symbols_[at], out);
      return 0;
    }
    indices.put(front + static_cast<std::uint32_t>(history_.size()), out);
    runs.put(std::min(run - 3, 63U), out);
    if (run - 3 >= 63) write_chunked(run - 3, 7, out);
    return run - 1;
  }

  std::mt19937 random_;
  int width_, height_, blocks_x_, blocks_y_;
  bool gray_ = false;
  std::vector<Endpoint> endpoints_;
  std::vector<Selector> selectors_;
  std::vector<std::uint32_t> history_;
  std::size_t rover_ = 0;
  std::vector<std::uint32_t> groups_;            ///< predictions of two by two blocks
  std::vector<std::uint32_t> block_endpoints_;   ///< row by row
  std::vector<std::uint32_t> block_selectors_;   ///< row by row
  std::vector<std::uint32_t> selector_symbols_;  ///< as encoded, without runs
};

TEST(Etc1s, RandomTexturesComeBackTexelByTexel) {
  std::mt19937 random(11);
  for (std::uint32_t seed = 0; seed < 60; ++seed) {
    const auto width = static_cast<int>(1 + random() % 200);
    const auto height = static_cast<int>(1 + random() % 200);
    RandomTexture texture(width, height, seed);
    const RgbImage decoded = texture.decoded();
    ASSERT_EQ(decoded.width, width);
    ASSERT_EQ(decoded.pixels, texture.expected().pixels) << width << " x " << height << ", seed " << seed;
  }
}

}  // namespace
}  // namespace tileflight::imaging::etc1s_test
