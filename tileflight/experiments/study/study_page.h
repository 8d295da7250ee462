#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "tileflight/core/drawing/drawing.h"

namespace tileflight::study {

/// A run in a scatter plot.
struct ScatterPoint {
  double x = 0, y = 0;
  std::size_t series = 0;  ///< index of its name
  std::string label;       ///< tooltip
};

/// A scatter plot with a mark and colour for each series. Axes of positive values may be logarithmic.
struct Scatter {
  std::string title;
  std::string x_label, y_label;
  bool x_is_logarithmic = false, y_is_logarithmic = false;
  std::vector<std::string> series;
  std::vector<ScatterPoint> points;
};

/// Draws a scatter plot. Points that are not finite, or not positive on a logarithmic axis, are left out.
drawing::Drawing to_drawing(const Scatter& scatter);

/// Returns the colours of the series as a style sheet: .series-0 …, distinguishable also with red-green blindness
/// (Okabe and Ito 2008).
std::string series_style();

/// Returns study.html of a study's folder: one self-contained page that loads nothing. `study`: study.json. Images of
/// the worst runs are read from `folder`.
std::string study_page(const nlohmann::json& study, const std::filesystem::path& folder);

}  // namespace tileflight::study
