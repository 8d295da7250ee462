#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace tileflight::evaluation {

/// Reads the keys of one JSON object; missing, unknown or mistyped keys throw an InputError of one line (where, key,
/// cause).
class JsonReader {
 public:
  /// `where`: the file; `path`: parent keys, for messages. Throws InputError if `object` is not a JSON object.
  JsonReader(const nlohmann::json& object, std::string where, std::string path);

  /// Null reads as NaN.
  double number(const std::string& key);
  std::size_t count(const std::string& key);
  std::string text(const std::string& key);
  std::vector<double> numbers(const std::string& key);
  std::vector<std::size_t> counts(const std::string& key);
  std::vector<std::string> texts(const std::string& key);
  const nlohmann::json& value(const std::string& key);
  JsonReader object(const std::string& key);
  /// Whether the key is present; for keys that older files lack.
  bool has(const std::string& key);

  std::vector<std::string> keys() const;
  std::string name(const std::string& key) const;
  [[noreturn]] void fail(const std::string& key, const std::string& cause) const;

  /// Throws InputError if the object has a key that was not read, with the most similar known key as a suggestion.
  void expect_all_read() const;

 private:
  const nlohmann::json* object_;
  std::string where_, path_;
  std::vector<std::string> asked_;
};

}  // namespace tileflight::evaluation
