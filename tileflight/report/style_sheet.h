#pragma once

#include <string>

namespace tileflight::report {

/// The page's style: light, dark (as the reader's system says) and printed.
std::string style_sheet();

/// The style of a drawing in a file of its own: light.
std::string drawing_style();

}  // namespace tileflight::report
