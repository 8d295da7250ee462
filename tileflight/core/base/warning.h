#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace tileflight {

namespace base {
class StrictSection;
}  // namespace base

/// Tells how much a warning weighs.
enum class Severity {
  kNote,     ///< something to know beside the result; a verdict may still be given
  kWarning,  ///< the result is likely wrong
  kError,    ///< the result is wrong or incomplete for certain
};

/// A condition, found by the program, that can make a result wrong; reported with the result.
struct Warning {
  std::string message;  ///< one sentence, with the relevant numbers
  std::string where;    ///< stage, frames or files
  Severity severity = Severity::kWarning;
  std::string remedy{};  ///< one sentence that says what to do; empty: nothing can be done
};

using Warnings = std::vector<Warning>;

/// Returns whether a result with this warning allows no verdict. Notes are only reported beside the verdict.
inline bool forbids_verdict(const Warning& warning) { return warning.severity != Severity::kNote; }

/// Returns "note", "warning" or "error".
const char* to_string(Severity severity);

/// Returns the severity of a word that to_string() gives. Throws InputError that names `where` for other words.
Severity parse_severity(const std::string& where, const std::string& word);

/// Returns the value of the key `warnings` of results: [{severity, message, where, remedy}].
nlohmann::json to_json(const Warnings& warnings);

/// Returns notes with these messages that all concern `where`.
Warnings make_notes(const std::vector<std::string>& messages, const std::string& where);

/// Throws InputError if a result has the key `doubts`, the earlier name of `warnings`. `file`: the file of the result.
void refuse_earlier_key(const nlohmann::json& result, const std::filesystem::path& file);

/// Reads the key `warnings` of a section; empty if the key is absent. Throws InputError as StrictSection does, and as
/// refuse_earlier_key().
Warnings read_warnings(base::StrictSection& section);

}  // namespace tileflight
