#include "tileflight/tiles/demo_place/lettering.h"

#include <array>
#include <cstddef>

namespace tileflight::demo_place {
namespace {

struct Glyph {
  char letter;
  std::array<unsigned char, 7> rows;  ///< top to bottom; bit 4 is the leftmost of 5 columns
};

constexpr std::array<Glyph, 22> kGlyphs{
    {{'0', {14, 17, 19, 21, 25, 17, 14}}, {'1', {4, 12, 4, 4, 4, 4, 14}},      {'2', {14, 17, 1, 6, 8, 16, 31}},
     {'3', {30, 1, 1, 14, 1, 1, 30}},     {'4', {2, 6, 10, 18, 31, 2, 2}},     {'5', {31, 16, 30, 1, 1, 17, 14}},
     {'6', {6, 8, 16, 30, 17, 17, 14}},   {'7', {31, 1, 2, 4, 8, 8, 8}},       {'8', {14, 17, 17, 14, 17, 17, 14}},
     {'9', {14, 17, 17, 15, 1, 2, 12}},   {'T', {31, 4, 4, 4, 4, 4, 4}},       {'I', {14, 4, 4, 4, 4, 4, 14}},
     {'L', {16, 16, 16, 16, 16, 16, 31}}, {'E', {31, 16, 16, 30, 16, 16, 31}}, {'F', {31, 16, 16, 30, 16, 16, 16}},
     {'G', {14, 17, 16, 23, 17, 17, 14}}, {'H', {17, 17, 17, 31, 17, 17, 17}}, {'O', {14, 17, 17, 17, 17, 17, 14}},
     {'M', {17, 27, 21, 21, 17, 17, 17}}, {'U', {17, 17, 17, 17, 17, 17, 14}}, {'S', {15, 16, 16, 14, 1, 1, 30}},
     {'A', {14, 17, 17, 31, 17, 17, 17}}}};

}  // namespace

bool is_ink(std::string_view text, double x, double y) {
  if (x < 0 || y < 0 || y >= 7) return false;
  const auto place = static_cast<std::size_t>(x / 6.0);
  const double column = x - 6.0 * static_cast<double>(place);
  if (place >= text.size() || column >= 5) return false;
  for (const Glyph& glyph : kGlyphs) {
    if (glyph.letter != text[place]) continue;
    const unsigned row = glyph.rows[6 - static_cast<std::size_t>(y)];
    return ((row >> (4 - static_cast<unsigned>(column))) & 1U) != 0;
  }
  return false;
}

}  // namespace tileflight::demo_place
