#pragma once

#include <string_view>

namespace tileflight::report {

/// The page's style: light, dark (as the reader's system says) and printed.
std::string_view style_sheet();

}  // namespace tileflight::report
