#pragma once

#include <string>
#include <vector>

#include "tileflight/report/html.h"

namespace tileflight::report {

/// Entry of a legend: a sample of the style and a name.
struct LegendEntry {
  std::string name;
  std::string style;
};
Html legend(const std::vector<LegendEntry>& entries);

/// What an SVG holds, in units of its view box (0, 0, width, height), before it stands on a page or in a file.
struct Drawing {
  double width = 0, height = 0;
  std::string style;  ///< class of the page's style sheet
  std::string label;  ///< for those who cannot see it
  Html content;
  std::vector<LegendEntry> legend{};
};

/// As an element of the page, which follows the page's colours; the legend follows as a list.
Html on_page(const Drawing& drawing);

/// Drawings below each other as a file of its own, with their legends and light colours.
std::string svg_file(const std::string& title, const std::vector<Drawing>& drawings);

}  // namespace tileflight::report
