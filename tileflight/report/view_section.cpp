#include "tileflight/report/view_section.h"

#include "tileflight/base/files.h"
#include "tileflight/report/page_script.h"
#include "tileflight/report/style_sheet.h"

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

Html view_section(const RunFolder& run, const ViewBudget& budget) {
  if (page_script().empty()) return {};
  const std::string data = view_data(run, budget);
  if (data.empty()) return {};
  return element("p", {{"class", "note"}, {"id", "view-note"}, {"role", "status"}}, text(kWithoutScript)) +
         element("div", {{"id", "view-host"}, {"data-state", "waiting"}}, Html()) +
         element("script", {{"type", "application/octet-stream"}, {"id", "view-data"}}, text(base64(data)));
}

Html view_script() { return page_script().empty() ? Html() : element("script", Html::trusted(script_text())); }

std::string content_policy() {
  const std::string script =
      page_script().empty() ? ""
                            : "; script-src 'sha256-" + base64(bytes_of_hex(base::sha256_hex(script_text()))) + "'";
  return "default-src 'none'; img-src data: blob:; style-src 'unsafe-inline'" + script;
}

Html page_head(const std::string& name) {
  const std::string style = style_sheet() + std::string(view_style());
  return element("head",
                 empty_element("meta", {{"charset", "utf-8"}}) +
                     empty_element("meta", {{"name", "viewport"}, {"content", "width=device-width, initial-scale=1"}}) +
                     empty_element("meta", {{"http-equiv", "Content-Security-Policy"}, {"content", content_policy()}}) +
                     element("title", text(name + " \u2013 tileflight")) + element("style", Html::trusted(style)));
}

}  // namespace tileflight::report
