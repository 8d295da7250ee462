#pragma once

#include <string_view>

namespace tileflight::tiling {

/// Whether (x, y) is on the ink of a line of capitals, digits and blanks, 7 units high from the base line, 6 units a
/// letter.
bool is_ink(std::string_view text, double x, double y);

/// Width of a text in the same units.
inline double text_width(std::string_view text) { return 6.0 * static_cast<double>(text.size()) - 1.0; }

}  // namespace tileflight::tiling
