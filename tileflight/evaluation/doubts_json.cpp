#include "tileflight/evaluation/doubts_json.h"

#include <nlohmann/json.hpp>

#include "tileflight/base/input_error.h"
#include "tileflight/evaluation/json_reader.h"

namespace tileflight::evaluation {

using nlohmann::json;

json to_json(const Doubts& doubts) {
  json list = json::array();
  for (const Doubt& d : doubts)
    list.push_back({{"what", d.what}, {"where", d.where}, {"how_sure", d.how_sure}, {"what_to_do", d.what_to_do}});
  return list;
}

Doubts doubts_from_json(const json& list, const std::string& where) {
  if (!list.is_array()) throw InputError(where, "key 'doubts' must be a list");
  Doubts doubts;
  for (const json& item : list) {
    JsonReader reader(item, where, "doubts");
    doubts.push_back({reader.text("what"), reader.text("where"), reader.text("how_sure"), reader.text("what_to_do")});
    reader.expect_all_read();
  }
  return doubts;
}

}  // namespace tileflight::evaluation
