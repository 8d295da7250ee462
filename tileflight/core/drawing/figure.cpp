#include "tileflight/core/drawing/figure.h"

#include <system_error>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/text_parsing.h"

namespace tileflight::drawing {
namespace {

/// Larger files are not embedded in the page.
constexpr std::size_t kMaxInlineBytes = 24'000;

std::string kind_of(const FigureFile& file) { return file.media_type == "text/csv" ? "CSV" : "SVG"; }

/// Labelled by its type, or by its name if a figure has several files of a type.
Html link(const FigureFile& file, bool by_name) {
  const bool in_page = file.bytes.size() <= kMaxInlineBytes;
  const std::string address = in_page ? data_uri(file.media_type, file.bytes) : "figures/" + file.name;
  const Html words =
      by_name ? text(file.name)
              : element("span", {{"class", "for-readers"}}, text("Save " + file.name + " as ")) + text(kind_of(file));
  return element("a", {{"href", address}, {"download", file.name}}, words);
}

}  // namespace

Html to_html(const Figure& figure) {
  if (figure.empty()) return {};
  Html caption = text(figure.caption);
  for (const FigureFile& file : figure.files) caption += text(" ") + link(file, figure.files.size() > 2);
  return element("figure", {{"class", figure.style}, {"id", "figure-" + figure.id}},
                 figure.content + element("figcaption", caption));
}

void write_figures(const std::filesystem::path& folder, const std::vector<Figure>& figures) {
  std::error_code error;  // ignored: writing the file reports the error
  std::filesystem::create_directories(folder, error);
  for (const Figure& figure : figures) {
    for (const FigureFile& file : figure.files) base::write_file(folder / file.name, file.bytes);
  }
}

std::string to_csv(const std::vector<std::vector<std::string>>& lines) {
  std::string csv;
  for (const std::vector<std::string>& fields : lines) {
    for (std::size_t i = 0; i < fields.size(); ++i) csv += (i > 0 ? "," : "") + base::csv_field(fields[i]);
    csv += "\r\n";
  }
  return csv;
}

}  // namespace tileflight::drawing
