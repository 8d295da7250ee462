#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tileflight/experiment/file_hashes.h"

namespace tileflight::experiment {

/// Told of a run's stages as they begin and end.
struct StageNews {
  enum class What { kBegins, kDone, kUnchanged };
  std::string stage;  ///< "simulated/dataset"
  What what = What::kBegins;
  double seconds = 0.0;  ///< that it took, where it is done
};
using StageListener = std::function<void(const StageNews&)>;

/// Does the stages of one run folder at most once for the same inputs. A stage's record (key of its inputs, seconds,
/// products) stands in DIR/stages/NAME.json and is written after its products are whole, so an interrupted run goes on
/// where it was. Inputs are told apart by their content, never by times of files.
class StageCache {
 public:
  /// `program`: what identifies the code that makes the results; it is part of every key. `hashes`: where those of
  /// files are kept between runs; empty: nowhere.
  StageCache(std::filesystem::path run_folder, std::string program, std::filesystem::path hashes = {},
             StageListener listener = {});

  /// Runs `work` unless a record with the same inputs is there and all `products` (relative to the run folder) still
  /// exist. Work replaces products that are there from other inputs; until then, and where it fails, they stay.
  /// Returns whether `work` ran.
  bool once(const std::string& name, const nlohmann::json& inputs, const std::vector<std::string>& products,
            const std::function<void()>& work);

  /// Whether a stage was done by this run of the program or is there from an earlier one that it asked for.
  bool has(const std::string& name) const { return done_.contains(name); }
  /// SHA-256 that a stage was last done with; what depends on the stage takes it as an input.
  std::string key(const std::string& name) const;
  /// Wall seconds that each stage took when it was done.
  std::map<std::string, double> seconds() const;

  /// Of the content of a file or folder, the run folder left out (file_hashes.h). Throws InputError.
  std::string content_of(const std::filesystem::path& file_or_folder) const;

  const std::filesystem::path& run_folder() const { return run_folder_; }

 private:
  std::filesystem::path record_file(const std::string& name) const;
  nlohmann::json read_record(const std::string& name) const;
  void tell(const std::string& stage, StageNews::What what, double seconds = 0.0) const;

  std::filesystem::path run_folder_;
  std::string program_;
  FileHashes hashes_;
  StageListener listener_;
  std::map<std::string, nlohmann::json> done_;
};

/// Makes an earlier run's stages, and those of its variants, be done again. Their products stay until then.
void forget_stages(const std::filesystem::path& run_folder);

/// SHA-256 of the running program's own file.
std::string program_fingerprint();

}  // namespace tileflight::experiment
