#include "tileflight/slam/odometry/direction_check.h"

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

namespace tileflight::odometry {
namespace {

/// Where later runs begin, as shares of the images. Of three flights over roofs that repeat, whose forward runs begin
/// wrongly at the first image and after an eighth, two begin rightly after a third.
constexpr std::array kLaterStarts{0.15, 0.3, 0.5};
/// At the latest: the images before are kept until then.
constexpr std::size_t kLatestStart = 150;

/// The part of a run that the comparison needs.
struct ComparedRun {
  RunStart start;
  geometry::Trajectory path;
  bool has_warnings = false;
};

bool agree(const ComparedRun& a, const ComparedRun& b, const WarningThresholds& limits) {
  const auto agreement = measure_agreement(a.path, b.path);
  return agreement && agreement->rms_share <= limits.disagreement;
}

/// The first of a direction's runs without warnings that another run of it agrees with, and that other; null: none.
std::pair<const ComparedRun*, const ComparedRun*> find_repeated(const std::vector<ComparedRun>& runs, bool against,
                                                                const WarningThresholds& limits) {
  for (std::size_t i = 0; i < runs.size(); ++i) {
    for (std::size_t j = i + 1; j < runs.size(); ++j) {
      const ComparedRun &a = runs[i], &b = runs[j];
      if (a.start.against != against || b.start.against != against || (a.has_warnings && b.has_warnings)) continue;
      if (agree(a, b, limits)) return a.has_warnings ? std::pair(&b, &a) : std::pair(&a, &b);
    }
  }
  return {nullptr, nullptr};
}

/// Decides between two directions that disagree, by runs that begin later.
class LaterRuns {
 public:
  LaterRuns(const OdometryResult& run, const OdometryResult& other, std::size_t images, const FurtherRun& track,
            const WarningThresholds& limits)
      : images_(images), track_(track), limits_(limits) {
    keep({.against = false, .image = 0}, run);
    keep({.against = true, .image = 0}, other);
  }

  /// Sets what is to be used, and what it is compared with, if one direction shows its path again and the other does
  /// not.
  void decide(DirectionCheck& check) {
    for (const double share : kLaterStarts) {
      const std::size_t image = std::min(kLatestStart, static_cast<std::size_t>(share * static_cast<double>(images_)));
      if (image <= runs_.back().start.image) return;
      for (const bool against : {false, true})
        keep({.against = against, .image = image}, track_({.against = against, .image = image}));
      const auto same = find_repeated(runs_, false, limits_), other = find_repeated(runs_, true, limits_);
      if (same.first == nullptr && other.first == nullptr) continue;
      const bool are_both = same.first != nullptr && other.first != nullptr;
      if (are_both && !agree(*same.first, *other.first, limits_)) return;  // the scale changed on the way
      const bool is_same = other.first == nullptr || (are_both && same.first->start.image <= other.first->start.image);
      const auto& [use, again] = is_same ? same : other;
      check.use = use->start;
      check.counterpart = counterpart_of(*use, *again);
      return;
    }
  }

 private:
  void keep(const RunStart& start, const OdometryResult& result) {
    runs_.push_back({start, result.trajectory, has_own_warnings(result, limits_)});
  }

  /// A run against the one that is used, if any agrees with it.
  const geometry::Trajectory& counterpart_of(const ComparedRun& use, const ComparedRun& again) const {
    for (const ComparedRun& run : runs_) {
      if (run.start.against != use.start.against && agree(use, run, limits_)) return run.path;
    }
    return again.path;
  }

  std::size_t images_;
  const FurtherRun& track_;
  const WarningThresholds& limits_;
  std::vector<ComparedRun> runs_;
};

}  // namespace

DirectionCheck check_directions(const OdometryResult& run, std::size_t images, bool may_use_other,
                                const FurtherRun& track, const WarningThresholds& limits) {
  const OdometryResult other = track({.against = true, .image = 0});
  const auto agreement = measure_agreement(run.trajectory, other.trajectory);
  const RunChoice choice = choose_run(run, other, agreement, limits);
  DirectionCheck check{.use = {}, .disagreement = {}, .counterpart = other.trajectory};
  if (choice == RunChoice::kOpen || choice == RunChoice::kRatherSecond) check.disagreement = agreement;
  if (!may_use_other) return check;
  check.use.against = choice == RunChoice::kSecond || choice == RunChoice::kRatherSecond;
  if (check.use.against) check.counterpart = run.trajectory;
  if (check.disagreement) LaterRuns(run, other, images, track, limits).decide(check);
  return check;
}

}  // namespace tileflight::odometry
