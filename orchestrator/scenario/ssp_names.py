"""Names that the SSP archives written here and those read here have in common."""

from __future__ import annotations

DESCRIPTION_FILE = "SystemStructure.ssd"
RESOURCES = "resources"
PARAMETER_SET = "scenario"
"""One set for all components: other programs apply a set by its name."""

SSD = "http://ssp-standard.org/SSP1/SystemStructureDescription"
SSC = "http://ssp-standard.org/SSP1/SystemStructureCommon"
SSV = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
SSM = "http://ssp-standard.org/SSP1/SystemStructureParameterMapping"
OSP = "http://opensimulationplatform.com/SSP/OSPAnnotations"
OMS = "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd"
OWN = "urn:yawbench:ssp:1"
NAMESPACES = {"ssd": SSD, "ssc": SSC, "ssv": SSV, "osp": OSP, "oms": OMS, "yawbench": OWN}
"""All declared at the root, with the prefixes that libcosim and Ecos take for granted: they compare
text, and libcosim takes a declaration further down for content."""

FMU_TYPE = "application/x-fmu-sharedlibrary"
VALUES_TYPE = "application/x-ssp-parameter-set"
MAPPING_TYPE = "application/x-ssp-parameter-mapping"

OSP_ANNOTATION = "com.opensimulationplatform"
OMS_ANNOTATION = "org.openmodelica"
OWN_ANNOTATION = "yawbench"
