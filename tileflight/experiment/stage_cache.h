#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace tileflight::experiment {

/// Does the stages of one run folder at most once for the same inputs. A stage's record (key of its inputs, seconds,
/// products) stands in DIR/stages/NAME.json and is written after its products are whole, so an interrupted run goes on
/// where it was.
class StageCache {
 public:
  /// `program`: what identifies the code that makes the results; it is part of every key.
  StageCache(std::filesystem::path run_folder, std::string program);

  /// Runs `work` unless a record with the same inputs is there and all `products` (relative to the run folder) still
  /// exist. Products that are there from other inputs are removed first. Returns whether `work` ran.
  bool once(const std::string& name, const nlohmann::json& inputs, const std::vector<std::string>& products,
            const std::function<void()>& work);

  /// Whether a stage was done by this run of the program or is there from an earlier one that it asked for.
  bool has(const std::string& name) const { return done_.contains(name); }
  /// SHA-256 that a stage was last done with; what depends on the stage takes it as an input.
  std::string key(const std::string& name) const;
  /// Wall seconds that each stage took when it was done.
  std::map<std::string, double> seconds() const;

  const std::filesystem::path& run_folder() const { return run_folder_; }

 private:
  std::filesystem::path record_file(const std::string& name) const;
  nlohmann::json read_record(const std::string& name) const;

  std::filesystem::path run_folder_;
  std::string program_;
  std::map<std::string, nlohmann::json> done_;
};

/// What a change of a file or folder changes: for a file its SHA-256; for a folder that of the list of its files with
/// their sizes and modification times (a tileset of gigabytes is not read twice). Throws InputError where there is
/// nothing.
std::string fingerprint(const std::filesystem::path& file_or_folder);

/// SHA-256 of the running program's own file.
std::string program_fingerprint();

}  // namespace tileflight::experiment
