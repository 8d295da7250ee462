#include "warnings_text.h"

#include <nlohmann/json.hpp>

namespace tileflight::app {

std::string warnings_text(const nlohmann::json& result) {
  const auto found = result.find("warnings");
  if (found == result.end() || !found->is_array()) return {};
  std::string text;
  for (const char* severity : {"error", "warning", "note"}) {
    for (const nlohmann::json& warning : *found) {
      if (warning.value("severity", "") != severity) continue;
      const std::string remedy = warning.value("remedy", "");
      text += std::string(severity) + " (" + warning.value("where", "") + "): " + warning.value("message", "") + "." +
              (remedy.empty() ? "" : " To do: " + remedy + ".") + "\n";
    }
  }
  return text;
}

}  // namespace tileflight::app
