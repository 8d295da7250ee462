#pragma once

#include <string_view>

namespace tileflight::demo_place {

/// Whether (x, y) is inside a letter stroke of a line of capitals, digits and blanks; 7 units high from the baseline, 6
/// units per letter.
bool is_ink(std::string_view text, double x, double y);

/// Width of a text in the same units.
inline double text_width(std::string_view text) { return 6.0 * static_cast<double>(text.size()) - 1.0; }

}  // namespace tileflight::demo_place
