// All of clratio::clratio; images are in clratio/image.hpp (clratio::io).
#pragma once

#include "clratio/combine.hpp"
#include "clratio/engine.hpp"
#include "clratio/error.hpp"
#include "clratio/estimator.hpp"
#include "clratio/exception.hpp"
#include "clratio/fit.hpp"
#include "clratio/fixed.hpp"
#include "clratio/histogram.hpp"
#include "clratio/law.hpp"
#include "clratio/medium.hpp"
#include "clratio/moments.hpp"
#include "clratio/snapshot.hpp"
#include "clratio/stream.hpp"
#include "clratio/view.hpp"
