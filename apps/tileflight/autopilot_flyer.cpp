#include "autopilot_flyer.h"

#ifdef TILEFLIGHT_LIVE
#include "tileflight/live/simulator/autopilot_flight.h"
#endif

namespace tileflight::app {

recording::AutopilotFlyer autopilot_flyer() {
#ifdef TILEFLIGHT_LIVE
  return simulator::render_autopilot_flight;
#else
  return {};
#endif
}

}  // namespace tileflight::app
