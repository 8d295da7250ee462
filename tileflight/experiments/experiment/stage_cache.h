#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tileflight/experiments/experiment/file_hash_cache.h"

namespace tileflight::experiment {

/// Start or end of a stage.
struct StageEvent {
  enum class Kind { kBegins, kDone, kUnchanged };
  std::string stage;  ///< "simulated/dataset"
  Kind kind = Kind::kBegins;
  double seconds = 0.0;  ///< duration, if it is done
};
using StageListener = std::function<void(const StageEvent&)>;

/// Executes the stages of a run folder at most once for the same inputs. A stage's record (key of its inputs, seconds,
/// products) is DIR/stages/NAME.json and is written after its products are complete, so an interrupted run continues
/// where it stopped. Inputs are compared by content, never by file times.
class StageCache {
 public:
  /// `program`: identifies the code that computes the results; it is part of every key. `hashes`: file for cached file
  /// hashes; empty: none. `original`: run folder of which this one is a variant; empty: none.
  StageCache(std::filesystem::path run_folder, std::string program, std::filesystem::path hashes = {},
             StageListener listener = {}, std::filesystem::path original = {});

  /// Runs `work` unless a record with the same inputs and all `products` (relative to the run folder) exist. Products
  /// from other inputs are replaced by the work; they are kept until then, and if it fails. A stage whose products are
  /// folders is taken over from the original run if that did it with the same inputs: the files are hard links (copies
  /// where the file system has none), and writers replace files, so neither run changes the other's. `take`: puts the
  /// products in place without the work, if it can, and returns whether it did. Returns whether `work` ran.
  bool run_stage(const std::string& name, const nlohmann::json& inputs, const std::vector<std::string>& products,
                 const std::function<void()>& work, const std::function<bool()>& take = {});

  /// Whether the stage is up to date in this run: executed, or found unchanged.
  bool is_done(const std::string& name) const { return done_.contains(name); }
  /// Key (SHA-256) of a stage's inputs; dependent stages use it as an input.
  std::string key(const std::string& name) const;
  /// Duration of each stage when it was executed, wall-clock seconds.
  std::map<std::string, double> seconds() const;

  /// Hash of a file's or folder's content, without the run folder (file_hash_cache.h). Throws InputError.
  std::string content_hash(const std::filesystem::path& file_or_folder) const;

  const std::filesystem::path& run_folder() const { return run_folder_; }

 private:
  std::filesystem::path record_file(const std::string& name) const;
  nlohmann::json read_record(const std::string& name) const;
  bool take_over(const std::string& name, const std::string& key, const std::vector<std::string>& products);
  void notify(const std::string& stage, StageEvent::Kind what, double seconds = 0.0) const;

  std::filesystem::path run_folder_;
  std::string program_;
  FileHashCache hashes_;
  StageListener listener_;
  std::filesystem::path original_;
  std::map<std::string, nlohmann::json> done_;
};

/// Marks the stages of an earlier run and of its variants as outdated. Their products are kept until they are replaced.
void invalidate_stages(const std::filesystem::path& run_folder);

}  // namespace tileflight::experiment
