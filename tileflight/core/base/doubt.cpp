#include "tileflight/core/base/doubt.h"

#include <nlohmann/json.hpp>

#include "tileflight/core/base/strict_section.h"

namespace tileflight {

using nlohmann::json;

json to_json(const Doubts& doubts) {
  json list = json::array();
  for (const Doubt& d : doubts)
    list.push_back({{"what", d.what}, {"where", d.where}, {"how_sure", d.how_sure}, {"what_to_do", d.what_to_do}});
  return list;
}

Doubts read_doubts(base::StrictSection& section) {
  Doubts doubts;
  for (base::StrictSection& doubt : section.sections("doubts")) {
    doubts.push_back({doubt.required_text("what"), doubt.required_text("where"), doubt.required_text("how_sure"),
                      doubt.required_text("what_to_do")});
    doubt.require_all_keys_used();
  }
  return doubts;
}

}  // namespace tileflight
