#pragma once

#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "tileflight/geometry/transform.h"

namespace tileflight::simulator {

/// Strict reader of an object in settings.json. Values of the wrong type or out of range throw InputError with their
/// path ("settings.json: Vehicles.Drone1.X"); keys that were not read become warnings, which point out names that
/// differ only in case. Keys may be read in any order.
class SettingsSection {
 public:
  /// `json` must outlive it. `warnings` receives the messages of warn_unknown_keys().
  SettingsSection(const nlohmann::json& json, std::string where, std::vector<std::string>& warnings);

  bool has(const char* key) const { return json_.contains(key); }
  double number(const char* key, double otherwise, double least = std::numeric_limits<double>::lowest(),
                double most = std::numeric_limits<double>::max());
  int integer(const char* key, int otherwise, int least, int most);
  bool boolean(const char* key, bool otherwise);
  std::string text(const char* key, const std::string& otherwise);
  /// One of `words`, case-insensitive; returned as spelled in `words`.
  std::string choice(const char* key, const std::string& otherwise, const std::vector<std::string>& words);
  std::vector<double> numbers(const char* key, std::size_t most);
  /// The object of a key; nullopt: absent.
  std::optional<SettingsSection> section(const char* key);
  /// The objects of a list.
  std::vector<SettingsSection> list(const char* key);
  /// Name and section of each member of an object, in the file's order of names.
  std::vector<std::pair<std::string, SettingsSection>> members(const char* key);
  /// X, Y, Z; Roll, Pitch, Yaw in degrees.
  geometry::Vec3 position(const geometry::Vec3& otherwise = geometry::Vec3::Zero());
  Eigen::Quaterniond orientation(const geometry::Vec3& roll_pitch_yaw_deg = geometry::Vec3::Zero());

  /// Marks keys that AirSim reads and that have no effect here.
  void mark_ignored(const std::vector<std::string>& keys);
  /// Warns of keys that were not read.
  void warn_unknown_keys();

  const std::string& where() const { return where_; }
  [[noreturn]] void fail(const std::string& key, const std::string& what) const;

 private:
  const nlohmann::json* find(const char* key);

  const nlohmann::json& json_;
  std::string where_;
  std::vector<std::string>& warnings_;
  std::set<std::string> known_;
};

}  // namespace tileflight::simulator
