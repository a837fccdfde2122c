// All of landing on a deck that moves. Library harco::land; docs/landing.md leads through it.
#pragma once

#include "harco/deck.hpp"
#include "harco/forecast.hpp"
#include "harco/landing_order.hpp"
#include "harco/level.hpp"
#include "harco/touchdown.hpp"
