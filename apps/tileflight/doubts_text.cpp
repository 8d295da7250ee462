#include "doubts_text.h"

#include <nlohmann/json.hpp>

namespace tileflight::app {

std::string doubts_text(const nlohmann::json& result) {
  const auto found = result.find("doubts");
  if (found == result.end() || !found->is_array()) return {};
  std::string text;
  for (const char* how_sure : {"certain", "likely", "possible"}) {
    for (const nlohmann::json& doubt : *found) {
      if (doubt.value("how_sure", "") != how_sure) continue;
      text += "doubt (" + std::string(how_sure) + ", " + doubt.value("where", "") + "): " + doubt.value("what", "") +
              ". To do: " + doubt.value("what_to_do", "") + ".\n";
    }
  }
  return text;
}

}  // namespace tileflight::app
