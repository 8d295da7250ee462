#include "tileflight/core/drawing/drawing.h"

#include <algorithm>
#include <system_error>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/drawing/html.h"
#include "tileflight/core/drawing/number_format.h"

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

constexpr double kMargin = 12, kTitle = 26, kLegendLine = 20, kSample = 24;

Html sample(const std::string& style, double x, double y) {
  return empty_element("line", {{"x1", svg_number(x + 1)},
                                {"y1", svg_number(y)},
                                {"x2", svg_number(x + kSample - 1)},
                                {"y2", svg_number(y)},
                                {"class", style}});
}

Html words(const std::string& content, double x, double y) {
  return element("text", {{"x", svg_number(x)}, {"y", svg_number(y)}}, text(content));
}

/// One entry per line, since the text width is only known to the viewer.
Html legend_lines(const std::vector<LegendEntry>& entries, double from_y) {
  Html lines;
  for (std::size_t i = 0; i < entries.size(); ++i) {
    const double y = from_y + kLegendLine * (static_cast<double>(i) + 0.5);
    lines += sample(entries[i].style, kMargin, y) + words(entries[i].name, 2 * kMargin + kSample, y + 4);
  }
  return lines;
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

Html svg_label(double x, double y, const std::string& anchor, const std::string& content) {
  return element("text", {{"x", svg_number(x)}, {"y", svg_number(y)}, {"text-anchor", anchor}}, text(content));
}

Html svg_line(double x1, double y1, double x2, double y2, const std::string& style) {
  return empty_element("line", {{"x1", svg_number(x1)},
                                {"y1", svg_number(y1)},
                                {"x2", svg_number(x2)},
                                {"y2", svg_number(y2)},
                                {"class", style}});
}

Html legend(const std::vector<LegendEntry>& entries) {
  if (entries.empty()) return {};
  Html list;
  for (const LegendEntry& entry : entries) {
    const Html line = element("svg", {{"viewBox", "0 0 24 10"}, {"class", "sample"}, {"aria-hidden", "true"}},
                              sample(entry.style, 0, 5));
    list += element("li", line + text(entry.name));
  }
  return element("ul", {{"class", "legend"}}, list);
}

Html on_page(const Drawing& drawing) {
  const std::string view_box = "0 0 " + svg_number(drawing.width) + " " + svg_number(drawing.height);
  return element("svg",
                 {{"viewBox", view_box}, {"role", "img"}, {"aria-label", drawing.label}, {"class", drawing.style}},
                 drawing.content) +
         legend(drawing.legend);
}

std::string svg_file(const std::string& title, const std::vector<Drawing>& drawings) {
  double width = 0, y = kMargin + kTitle;
  Html content = element("title", text(title)) + element("style", Html::trusted(drawing_style())) +
                 element("text", {{"x", svg_number(kMargin)}, {"y", "26"}, {"class", "title"}}, text(title));
  for (const Drawing& drawing : drawings) {
    const std::string move = "translate(" + svg_number(kMargin) + " " + svg_number(y) + ")";
    content += element("g", {{"transform", move}, {"class", drawing.style}}, drawing.content);
    y += drawing.height;
    content += legend_lines(drawing.legend, y);
    y += kLegendLine * static_cast<double>(drawing.legend.size());
    width = std::max(width, drawing.width);
  }
  const std::string across = svg_number(width + 2 * kMargin), down = svg_number(y + kMargin);
  const Html paper = empty_element("rect", {{"width", across}, {"height", down}, {"class", "paper"}});
  const Html svg = element("svg",
                           {{"xmlns", "http://www.w3.org/2000/svg"},
                            {"viewBox", "0 0 " + across + " " + down},
                            {"width", across},
                            {"height", down}},
                           paper + content);
  return svg.str() + "\n";
}

}  // namespace tileflight::drawing
