#pragma once

#include <string>

namespace tileflight::drawing {

/// The page's style sheet: light, dark (by the reader's system setting) and print.
std::string style_sheet();

/// Style sheet of a standalone drawing file: light colours.
std::string drawing_style();

}  // namespace tileflight::drawing
