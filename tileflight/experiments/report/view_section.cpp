#include "tileflight/experiments/report/view_section.h"

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/raw_bytes.h"
#include "tileflight/core/drawing/html.h"
#include "tileflight/experiments/report/page_script.h"

namespace tileflight::report {
namespace {

constexpr const char* kWithoutScript =
    "The interactive view needs a browser with JavaScript and WebGL 2. The figures on this page show the same place, "
    "maps and paths.";

/// Content of the script element: a CDATA section for XML, whose markers are comments in the script.
std::string script_text() { return "//<![CDATA[\n" + std::string(page_script()) + "\n//]]>"; }

std::string bytes_of_hex(const std::string& hex) {
  std::string bytes;
  for (std::size_t i = 0; i + 1 < hex.size(); i += 2)
    bytes += static_cast<char>(std::stoi(hex.substr(i, 2), nullptr, 16));
  return bytes;
}

}  // namespace

drawing::Html view_section(const RunFolder& run, const ViewBudget& budget) {
  if (page_script().empty()) return {};
  const std::string data = view_data(run, budget);
  if (data.empty()) return {};
  return drawing::element("p", {{"class", "note"}, {"id", "view-note"}, {"role", "status"}},
                          drawing::text(kWithoutScript)) +
         drawing::element("div", {{"id", "view-host"}, {"data-state", "waiting"}}, drawing::Html()) +
         drawing::element("script", {{"type", "application/octet-stream"}, {"id", "view-data"}},
                          drawing::text(base::base64(data)));
}

drawing::Html view_script() {
  return page_script().empty() ? drawing::Html() : drawing::element("script", drawing::Html::trusted(script_text()));
}

std::string content_policy() {
  const std::string script =
      page_script().empty()
          ? ""
          : "; script-src 'sha256-" + base::base64(bytes_of_hex(base::sha256_hex(script_text()))) + "'";
  return "default-src 'none'; img-src data: blob:; style-src 'unsafe-inline'" + script;
}

drawing::Html page_head(const std::string& name) {
  const std::string style = drawing::style_sheet() + std::string(view_style());
  return drawing::element(
      "head",
      drawing::empty_element("meta", {{"charset", "utf-8"}}) +
          drawing::empty_element("meta", {{"name", "viewport"}, {"content", "width=device-width, initial-scale=1"}}) +
          drawing::empty_element("meta", {{"http-equiv", "Content-Security-Policy"}, {"content", content_policy()}}) +
          drawing::element("title", drawing::text(name + " \u2013 tileflight")) +
          drawing::element("style", drawing::Html::trusted(style)));
}

}  // namespace tileflight::report
