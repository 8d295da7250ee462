#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "tileflight/base/progress.h"

namespace tileflight::experiment {

/// Ground truths that several runs share, each made once: FOLDER/KEY, where KEY is a hash of all that the truth comes
/// from, with FOLDER/KEY.json, which lists its files and is written last. A run's truth is hard links to the files of
/// an entry (copies on another file system), so an entry, or the whole folder, can be removed at any time without harm
/// to a run; nothing removes a whole entry by itself. Processes wait for the one that makes an entry; an entry that a
/// killed process left, or whose files were changed since, is made again.
class TruthCache {
 public:
  /// Writes a truth into a folder that may exist.
  using Extract = std::function<void(const std::filesystem::path& folder)>;

  /// `folder`: empty: nothing is shared. `refresh`: entries are made again once. `source`: of the runs, as extract.json
  /// names it; an entry may have been made from the same tiles elsewhere.
  TruthCache(std::filesystem::path folder, std::string source, bool refresh, const Progress& progress);

  /// Puts the truth of an entry in place, if there is one. Throws InputError.
  bool take(const std::string& key, const std::filesystem::path& truth) const;

  /// Makes the entry, and puts it in place. Throws InputError.
  void make(const std::string& key, const std::filesystem::path& truth, const Extract& extract) const;

 private:
  bool link(const std::string& key, const std::filesystem::path& truth) const;

  std::filesystem::path folder_;
  std::string source_;
  bool refresh_;
  const Progress& progress_;
};

}  // namespace tileflight::experiment
