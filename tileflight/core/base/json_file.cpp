#include "tileflight/core/base/json_file.h"

#include <nlohmann/json.hpp>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::base {

nlohmann::json read_json(const std::filesystem::path& file) {
  nlohmann::json value = nlohmann::json::parse(read_text(file), nullptr, false);
  if (value.is_discarded()) throw InputError(file.string(), "is not valid JSON");
  return value;
}

}  // namespace tileflight::base
