#include "tileflight/core/base/warning.h"

#include <nlohmann/json.hpp>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/strict_section.h"

namespace tileflight {

using nlohmann::json;

namespace {

constexpr const char* kEarlierKey =
    "is called 'warnings' now, a list of {severity, message, where, remedy}; make the file again";

}  // namespace

const char* to_string(Severity severity) {
  switch (severity) {
    case Severity::kNote:
      return "note";
    case Severity::kWarning:
      return "warning";
    case Severity::kError:
      return "error";
  }
  return "";
}

Severity parse_severity(const std::string& where, const std::string& word) {
  for (const Severity severity : {Severity::kNote, Severity::kWarning, Severity::kError})
    if (word == to_string(severity)) return severity;
  throw InputError(where, "\"" + word + "\" is no severity; there are: note, warning, error");
}

json to_json(const Warnings& warnings) {
  json list = json::array();
  for (const Warning& w : warnings)
    list.push_back(
        {{"severity", to_string(w.severity)}, {"message", w.message}, {"where", w.where}, {"remedy", w.remedy}});
  return list;
}

Warnings make_notes(const std::vector<std::string>& messages, const std::string& where) {
  Warnings notes;
  for (const std::string& message : messages) notes.push_back({message, where, Severity::kNote, ""});
  return notes;
}

void refuse_earlier_key(const json& result, const std::filesystem::path& file) {
  if (result.is_object() && result.contains("doubts"))
    throw InputError(file.string(), std::string("'doubts' ") + kEarlierKey);
}

Warnings read_warnings(base::StrictSection& section) {
  if (section.has("doubts")) throw section.error("doubts", kEarlierKey);
  Warnings warnings;
  for (base::StrictSection& entry : section.sections("warnings")) {
    const std::string severity = entry.required_text("severity");
    warnings.push_back({entry.required_text("message"), entry.required_text("where"),
                        parse_severity(entry.place(), severity), entry.required_text("remedy")});
    entry.require_all_keys_used();
  }
  return warnings;
}

}  // namespace tileflight
