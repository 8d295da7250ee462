#pragma once

#include "tileflight/capture/recording/render_stage.h"

namespace tileflight::app {

/// Flies the autopilots of FLIGHT files in this program's simulator; empty in a program without one.
recording::AutopilotFlyer autopilot_flyer();

}  // namespace tileflight::app
