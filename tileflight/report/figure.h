#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tileflight/report/html.h"

namespace tileflight::report {

/// A file that goes with a figure.
struct FigureFile {
  std::string name;        ///< in the folder `figures`
  std::string media_type;  ///< "image/svg+xml" or "text/csv"
  std::string bytes;
};

/// A figure of the page, its files, and its numbers.
struct Figure {
  std::string id;       ///< of its element and its files
  std::string style{};  ///< class of the page's style sheet
  Html content{};
  std::string caption{};
  std::vector<FigureFile> files{};
  nlohmann::json series{};  ///< for report.json: [{name, points [[x, y]]}], or null where the numbers are in files only

  bool empty() const { return content.empty(); }
};

/// The <figure>, with links to its files: small ones are in the page itself, the others beside it. Empty markup for an
/// empty figure.
Html draw(const Figure& figure);

/// Writes the files of all figures into the folder, which is made. Throws InputError.
void write_figures(const std::filesystem::path& folder, const std::vector<Figure>& figures);

/// Lines of CSV (RFC 4180).
std::string csv_of(const std::vector<std::vector<std::string>>& lines);

}  // namespace tileflight::report
