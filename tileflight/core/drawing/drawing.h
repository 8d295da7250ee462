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

/// Entry of a legend: a sample of the style and a name.
struct LegendEntry {
  std::string name;
  std::string style;
};
Html legend(const std::vector<LegendEntry>& entries);

/// Draws a line between two points, with a class of the page's style sheet.
Html svg_line(double x1, double y1, double x2, double y2, const std::string& style);

/// Draws a text in the page's style. `anchor` is SVG's text-anchor: "start", "middle" or "end".
Html svg_label(double x, double y, const std::string& anchor, const std::string& content);

/// Content of an SVG, in units of its view box (0, 0, width, height), independent of whether it is put on a page or in
/// a file.
/// The markup is written here rather than by Cairo's SVG surface, which fixes colours and turns text into outlines: a
/// page's drawings take their colours from its style sheet (light, dark, print), and their text can be searched, copied
/// and read aloud.
struct Drawing {
  double width = 0, height = 0;
  std::string style;  ///< class of the page's style sheet
  std::string label;  ///< for screen readers
  Html content;
  std::vector<LegendEntry> legend{};
};

/// Returns the drawing as an element of the page, in the page's colours, followed by its legend as a list.
Html on_page(const Drawing& drawing);

/// Returns a standalone SVG file with the drawings one below the other, their legends, and light colours.
std::string svg_file(const std::string& title, const std::vector<Drawing>& drawings);

}  // namespace tileflight::drawing
