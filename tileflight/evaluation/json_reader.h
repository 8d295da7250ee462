#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace tileflight::evaluation {

/// Reads the keys of one JSON object and complains in one line (where, key, cause) about what is missing, unknown or of
/// the wrong type.
class JsonReader {
 public:
  /// `where`: the file; `path`: the keys that lead here, for messages. Throws InputError when `object` is none.
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
  /// Whether the key is there; for those that older files lack.
  bool has(const std::string& key);

  std::vector<std::string> keys() const;
  std::string name(const std::string& key) const;
  [[noreturn]] void fail(const std::string& key, const std::string& cause) const;

  /// Throws InputError when a key was not asked for, naming the known key that is spelled most like it.
  void expect_all_read() const;

 private:
  const nlohmann::json* object_;
  std::string where_, path_;
  std::vector<std::string> asked_;
};

}  // namespace tileflight::evaluation
