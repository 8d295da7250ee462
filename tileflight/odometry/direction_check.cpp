#include "tileflight/odometry/direction_check.h"

#include <algorithm>
#include <utility>

namespace tileflight::odometry {
namespace {

/// Share of the images without which a run begins at another place, and still shows nearly the same path.
constexpr double kLeftOutShare = 0.15;
/// As many at least: some initializations take as long.
constexpr std::size_t kFewestLeftOut = 8;

/// Whether two runs show the same path, over at least half of the images.
bool agree(const geometry::Trajectory& a, const geometry::Trajectory& b, std::size_t images,
           const DoubtThresholds& limits) {
  const auto agreement = measure_agreement(a, b);
  return agreement && 2 * agreement->pictures >= images && agreement->rms_share <= limits.disagreement;
}

/// Decides between two directions that disagree, by a later run in each.
class LaterRuns {
 public:
  LaterRuns(const geometry::Trajectory& run, const geometry::Trajectory& other, std::size_t images,
            const FurtherRun& track, const DoubtThresholds& limits) {
    const std::size_t left_out =
        std::max(kFewestLeftOut, static_cast<std::size_t>(kLeftOutShare * static_cast<double>(images)));
    if (2 * left_out > images) return;
    same_ = track(Direction::kSame, left_out).trajectory;
    other_ = track(Direction::kOther, left_out).trajectory;
    same_confirms_run_ = agree(same_, run, images, limits);
    same_confirms_other_ = agree(same_, other, images, limits);
    other_confirms_run_ = agree(other_, run, images, limits);
    other_confirms_other_ = agree(other_, other, images, limits);
  }

  /// An independent run agrees with one of both, and none with the other.
  bool answer() const { return other_confirms_run_ != same_confirms_other_; }
  /// With answer(): it is the run in the other direction that was confirmed.
  bool answer_is_other() const { return same_confirms_other_; }
  /// With answer(): the independent run.
  const geometry::Trajectory& counterpart() const { return answer_is_other() ? same_ : other_; }
  /// One is found again in its own direction, the other is not. That tells less: the same images in the same order
  /// may mislead twice.
  bool hint() const { return same_confirms_run_ != other_confirms_other_; }
  bool hint_is_other() const { return other_confirms_other_; }

 private:
  geometry::Trajectory same_, other_;
  bool same_confirms_run_ = false, same_confirms_other_ = false;
  bool other_confirms_run_ = false, other_confirms_other_ = false;
};

}  // namespace

DirectionCheck check_directions(const OdometryResult& run, std::size_t images, bool may_use_other,
                                const FurtherRun& track, const DoubtThresholds& limits) {
  const OdometryResult other = track(Direction::kOther, 0);
  const auto agreement = measure_agreement(run.trajectory, other.trajectory);
  const RunChoice choice = choose_run(run, other, agreement, limits);
  DirectionCheck check{.counterpart = other.trajectory};
  if (choice == RunChoice::kOpen || choice == RunChoice::kRatherSecond) check.disagreement = agreement;
  if (!may_use_other) return check;
  check.use_other = choice == RunChoice::kSecond || choice == RunChoice::kRatherSecond;
  if (check.disagreement) {
    const LaterRuns later(run.trajectory, other.trajectory, images, track, limits);
    check.disagreement->is_answered = later.answer();
    if (later.answer()) {
      check.use_other = later.answer_is_other();
      check.counterpart = later.counterpart();
      return check;
    }
    if (later.hint()) check.use_other = later.hint_is_other();
  }
  if (check.use_other) check.counterpart = run.trajectory;
  return check;
}

}  // namespace tileflight::odometry
