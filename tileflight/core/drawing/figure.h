#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tileflight/core/drawing/html.h"

namespace tileflight::drawing {

/// A file that accompanies a figure.
struct FigureFile {
  std::string name;        ///< in the folder `figures`
  std::string media_type;  ///< "image/svg+xml" or "text/csv"
  std::string bytes;
};

/// A figure of the page with its files and numbers.
struct Figure {
  std::string id;       ///< of its HTML element and its files
  std::string style{};  ///< class of the page's style sheet
  Html content{};
  std::string caption{};
  std::vector<FigureFile> files{};
  nlohmann::json series{};  ///< for report.json: [{name, points [[x, y]]}], or null if the numbers are only in files

  bool empty() const { return content.empty(); }
};

/// Returns the <figure> element with links to its files: small files are embedded in the page, others are linked. Empty
/// for an empty figure.
Html to_html(const Figure& figure);

/// Writes the files of all figures into the folder, creating it if necessary. Throws InputError.
void write_figures(const std::filesystem::path& folder, const std::vector<Figure>& figures);

/// Returns lines of CSV (RFC 4180).
std::string to_csv(const std::vector<std::vector<std::string>>& lines);

}  // namespace tileflight::drawing
